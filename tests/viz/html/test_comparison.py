"""The report of a comparison tells of what was compared in the order that was asked for."""

from pathlib import Path

import pandas as pd
import pytest
from omegaconf import OmegaConf

from hyuav.experiments.comparison.tables import label
from hyuav.viz.html.comparison import comparison_page

SCENARIOS = ["two_clusters", "random_disk"]
ASKED = {
    "algorithm": ["sac", "ddpg_robust", "ddpg"],
    "without": ["repeat_every", "clock"],
    "scenario": SCENARIOS,
    "num_slots": [9, 10],
}
VARIANTS = ["ddpg_robust", "ddpg_robust-repeat_every", "ddpg_robust-clock"]


def shards(directory: Path) -> None:
    """Two learners of each entry, scenario and horizon."""
    for algorithm in ("ddpg", *VARIANTS, "sac"):
        for scenario in SCENARIOS:
            for num_slots in (9, 10):
                shard = directory / "shards" / f"{algorithm}_{scenario}_T{num_slots}"
                shard.mkdir(parents=True)
                learner = {"algorithm": algorithm, "scenario": scenario, "num_slots": num_slots}
                learners = [{**learner, "scheme": "relay", "seed": seed} for seed in (0, 1)]
                curves = pd.DataFrame(learners).assign(episode=10, fraction=0.9)
                unknown = {"episodes_to_threshold": None, "seconds_to_threshold": None}
                results = curves.assign(**unknown, seconds=1.0).drop(columns="episode")
                curves.to_parquet(shard / "curves.parquet")
                results.to_parquet(shard / "results.parquet")


@pytest.mark.parametrize(
    ("config", "entries", "scenarios"),
    [
        (ASKED, ["sac", *VARIANTS, "ddpg"], SCENARIOS),
        ({"algorithm": 7}, ["ddpg", *VARIANTS[:0:-1], VARIANTS[0], "sac"], sorted(SCENARIOS)),
    ],
    ids=["asked", "damaged"],
)
def test_entries_stand_in_the_order_of_the_configuration(
    tmp_path: Path, config: dict[str, object], entries: list[str], scenarios: list[str]
) -> None:
    shards(tmp_path)
    (tmp_path / "config.yaml").write_text(OmegaConf.to_yaml(config))
    page = comparison_page(tmp_path)
    assert page.facts["Algorithms"] == ", ".join(map(label, entries))
    ((_, cells),) = (own.tables for own in page.sections if own.title == "Results")
    assert cells.index(scenarios[0]) < cells.index(scenarios[1])
