import json
from pathlib import Path
from typing import Any

import pytest

from hyuav import Scenario
from hyuav._support.errors import InputError
from hyuav.experiments.evaluation import Evaluation
from hyuav.experiments.run_directory import RunDirectory
from hyuav.viz.data.reading import (
    is_drawable,
    read_evaluation,
    read_flights,
    readable_config,
    readable_evaluation,
    readable_flights,
    references_of,
)

pytest_plugins = "sample_runs"


def test_what_is_whole_is_read(evaluated: RunDirectory) -> None:
    content = json.loads((evaluated.path / "evaluation.json").read_text())
    assert readable_evaluation(evaluated.path) == content
    flights = readable_flights(evaluated.path)
    assert flights is not None
    assert set(flights["scheme"]) == set(content["schemes"])
    assert readable_config(evaluated.path)["algorithm"]["name"] == "ddpg"


def test_a_missing_file_is_nothing(tmp_path: Path) -> None:
    assert readable_config(tmp_path) == {}
    assert readable_evaluation(tmp_path) is None
    assert readable_flights(tmp_path) is None


@pytest.mark.parametrize("share", [0.0, 0.3, 0.99])
def test_a_file_cut_off_is_nothing(share: float, tmp_path: Path, evaluated: RunDirectory) -> None:
    for name in ("evaluation.json", "flights.parquet"):
        whole = (evaluated.path / name).read_bytes()
        (tmp_path / name).write_bytes(whole[: int(share * len(whole))])
    assert readable_evaluation(tmp_path) is None
    assert readable_flights(tmp_path) is None


@pytest.mark.parametrize(
    "content",
    [
        [],
        {"schemes": {}},
        {"schemes": {"proposed": 3}, "num_slots": 20, "episodes": 4},
        {"schemes": {"proposed": {"secrecy_sum_rate": {}}}, "num_slots": 20, "episodes": 4},
    ],
)
def test_another_programs_evaluation_is_nothing(content: Any, tmp_path: Path) -> None:
    (tmp_path / "evaluation.json").write_text(json.dumps(content))
    assert readable_evaluation(tmp_path) is None


def test_what_is_missing_or_lacks_a_column_is_refused_in_a_line(
    tmp_path: Path, evaluated: RunDirectory
) -> None:
    with pytest.raises(InputError, match=r"^there is no evaluation\.json in [^\n]+$"):
        read_evaluation(tmp_path)
    flights = read_flights(evaluated.path).drop(columns="relay")
    flights.to_parquet(tmp_path / "flights.parquet")
    with pytest.raises(InputError, match=r"flights of an evaluation in Parquet \(with relay\)$"):
        read_flights(tmp_path)


def test_learners_are_set_beside_the_optimum_of_each_mode_rule_and_no_helper(
    evaluated: RunDirectory,
) -> None:
    content = read_evaluation(evaluated.path)
    best = {name: own["secrecy_sum_rate"]["mean"] for name, own in content["schemes"].items()}
    assert references_of(content) == {
        "hybrid": best["optimum"],
        "jamming": best["ja_optimum"],
        "relay": best["re_optimum"],
        "no_helper": best["no_helper"],
    }


def test_flights_of_several_helpers_are_read_where_all_of_their_columns_are_there(
    relaying_and_jamming: tuple[Scenario, Evaluation], tmp_path: Path
) -> None:
    scenario, evaluation = relaying_and_jamming
    evaluation.save(tmp_path)
    flights = read_flights(tmp_path)
    assert is_drawable(flights, scenario)
    assert not is_drawable(flights, Scenario.preset("two_clusters"))
    for column in ("relay_2", "way"):
        flights.drop(columns=column).to_parquet(tmp_path / "flights.parquet")
        with pytest.raises(InputError, match=rf"\(with {column}\)$"):
            read_flights(tmp_path)
