"""The benchmark's recipe, at a size that measures nothing but that it works."""

import json
import math
from pathlib import Path

import pandas as pd
import pytest
from rich.console import Console

from benchmarks import plan
from benchmarks.charts import draw
from benchmarks.measure import Entry, job_seconds
from benchmarks.results import Results
from benchmarks.tables import print_tables
from benchmarks.work import Work
from hyuav import Scenario
from hyuav._support import machine
from hyuav._support.errors import InputError
from hyuav._support.machine import cores
from recipe_calls import Call, Refusal

TINY = ["rounds=2", "seconds=0.05", "learners=2", "batches=[1,16]", "hydra.run.dir=run"]


def pictures(directory: Path) -> set[str]:
    return {path.name for path in directory.iterdir()}


def test_the_benchmark_measures_prints_keeps_and_draws(
    call: Call,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr("benchmarks.parts.threads_to_try", lambda: [1])
    monkeypatch.setattr("benchmarks.arithmetic.MATRIX_SIZES", (64,))
    pytest.importorskip("stable_baselines3")
    call(
        "benchmark",
        "parts=[training,environment]",
        "peers=[cleanrl,stable_baselines3]",
        "compile=never",
        *TINY,
    )
    rows = pd.read_parquet(tmp_path / "run" / "benchmark.parquet")
    content = json.loads((tmp_path / "run" / "benchmark.json").read_text())
    summary = pd.DataFrame(content["summary"])
    assert content["machine"]["cores"] == cores()
    assert content["machine"]["versions"]["torch"] is not None
    trained = summary[summary["part"] == "training"].set_index("entry")
    assert set(trained.index) == {"hyuav", "hyuav_robust", "cleanrl", "stable_baselines3"}
    assert trained.loc["hyuav", "learners"] == 2
    reference = trained.loc["stable_baselines3", "median"]
    for entry, row in trained.iterrows():
        assert row["low"] <= row["median"] <= row["high"]
        assert math.isclose(row["ratio_to_stable_baselines3"], row["median"] / reference)
        if entry == "hyuav_robust":  # whose arithmetic is not DDPG's
            assert row["share_of_floor"] is None or math.isnan(row["share_of_floor"])
        else:
            assert math.isclose(row["share_of_floor"], row["median"] / row["floor"])
        assert row["peak_mebibytes"] > 100
        measured = rows[(rows["part"] == "training") & (rows["entry"] == entry)]
        assert sorted(measured["round"]) == [1, 2]
        assert math.isclose(measured["steps_per_second"].median(), row["median"])
    flown = summary[summary["part"] == "environment"]
    assert len(flown) == 1 + 2 * 2  # no batch is worth compiling for
    assert (flown["peak_mebibytes"] > 10).all()
    draws = flown[flown["entry"] == "random_numbers"]
    assert (draws["share_of_floor"] == 1.0).all()
    figures = {f"{name}.{kind}" for name in ("training", "environment") for kind in ("png", "pdf")}
    assert pictures(tmp_path / "run" / "figures") == figures
    printed = capsys.readouterr().out.splitlines()
    assert any("HyUAV, 2 learners" in line for line in printed)
    assert max(len(line) for line in printed if not line.startswith("benchmark:")) <= 80


def test_a_job_is_timed_from_the_process_to_its_end() -> None:
    scenario = Scenario.preset("two_clusters")
    row = job_seconds("job", Entry("cleanrl", Work(scenario, episodes=5)), 1)
    assert row["steps"] == 5 * scenario.num_slots
    assert row["seconds"] > row["start_up_seconds"] > 0
    assert row["peak_mebibytes"] > 100


def invented_rows() -> list[dict[str, object]]:
    """A run of all parts whose steps/s are round numbers."""

    def row(part: str, entry: str, rate: float, **work: int) -> dict[str, object]:
        size = {"learners": 1, "helpers": 1, "num_ues": 10, "num_slots": 20, "threads": 1}
        facts = ("start_up_seconds", "build_seconds", "warm_up_seconds")
        measured = {"round": 1, "steps": 20_000, "seconds": 20_000 / rate, "steps_per_second": rate}
        return {
            "part": part,
            "entry": entry,
            "device": "cpu",
            **(size | work),
            **measured,
            **dict.fromkeys(facts, 12.5),
            "peak_mebibytes": 512.0,
        }

    return [
        row("training", "hyuav", 800.0),
        row("training", "hyuav", 2345.0, learners=10),
        row("training", "hyuav_robust", 1234.0, learners=10),
        *(row("training", peer, 200.0) for peer in ("stable_baselines3", "sbx")),
        row("job", "hyuav", 400.0),
        row("job", "hyuav", 1300.0, learners=10),
        row("job", "stable_baselines3", 100.0),
        *(row("learners", "hyuav", 1000.0 * n, learners=n) for n in (1, 2, 64)),
        *(row("ues", "hyuav", 900.0, num_ues=n) for n in (10, 1000)),
        *(row("ues", "hyuav", 1900.0, num_ues=n, learners=10) for n in (10, 1000)),
        *(row("ues", "stable_baselines3", 100.0, num_ues=n) for n in (10, 1000)),
        *(row("horizon", "hyuav", 900.0, num_slots=n) for n in (10, 100)),
    ]


def test_every_part_is_printed_within_80_columns_and_drawn(tmp_path: Path) -> None:
    machine = {"processor": "P", "cores": 2, "gpu": None}
    results = Results(machine, {"cpu": 2e11}, invented_rows())
    console = Console(record=True, width=80)
    print_tables(results, console)
    printed = console.export_text()
    assert "4.00" in printed  # 400 beside 100 steps/s
    assert "13.00" in printed
    assert max(map(len, printed.splitlines())) <= 80
    assert "…" not in printed
    draw(results, tmp_path)
    figures = {f"{name}.{kind}" for name in ("training", "scaling") for kind in ("png", "pdf")}
    assert pictures(tmp_path) == figures


def test_of_several_numbers_of_threads_the_fastest_counts() -> None:
    one, two = invented_rows()[0], {**invented_rows()[0], "threads": 2, "steps_per_second": 900.0}
    summary = Results({}, {"cpu": 2e11}, [one, two]).summary()
    assert summary["threads"].tolist() == [2]
    assert summary["median"].tolist() == [900.0]


def test_an_entry_that_fails_says_why() -> None:
    work = Work(Scenario.preset("two_clusters"), device="nowhere")
    with pytest.raises(InputError, match=r"random_numbers cannot be run: RuntimeError: .*nowhere"):
        job_seconds("job", Entry("random_numbers", work), 1)


REFUSALS = [
    (
        ["parts=speed"],
        "parts = 'speed': expected one of training, environment, job",
    ),
    (["peers=[sb4]"], "peers[0] = 'sb4': expected one of stable_baselines3, sbx"),
    (["seconds=0"], "seconds = 0: expected a finite number > 0"),
    (["learners=[1,0]"], "learners[1] = 0: expected a whole number >= 1"),
    (["round=3"], "configuration: unknown field 'round': did you mean 'rounds'"),
]


@pytest.mark.parametrize(("arguments", "line"), REFUSALS, ids=[a[0] for a, _ in REFUSALS])
def test_a_mistake_is_answered_by_one_line_and_status_2(
    refusal: Refusal, tmp_path: Path, arguments: list[str], line: str
) -> None:
    assert line in refusal("benchmark", *arguments)
    assert not list(tmp_path.glob("runs/*"))


def test_missing_libraries_are_named_with_the_way_to_get_them(
    refusal: Refusal, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(machine, "_can_be_found", lambda library: library == "stable_baselines3")
    line = "error: sbx, jax cannot be imported: pip install 'hyuav[bench]'\n"
    assert refusal("benchmark", "parts=training") == line


def test_only_the_libraries_that_are_measured_are_needed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(machine, "_can_be_found", lambda _: False)
    plan.require_peers(("environment",), plan.PEERS)
    plan.require_peers(("training", "job"), ("cleanrl", "torchrl"))
    with pytest.raises(InputError, match="stable_baselines3"):
        plan.require_peers(("job",), plan.PEERS)
