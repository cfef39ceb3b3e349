import os
import time
from pathlib import Path

import pandas as pd
import pytest

from dashboard_runs import WriteRun, metrics_row
from hyuav._support.errors import InputError
from hyuav.experiments.metrics import parse_rows
from hyuav.viz.data.index import MOST_DRAWN, RUNNING_SECONDS, RunIndex


def test_a_run_is_listed_with_what_it_is_and_how_far_it_has_come(
    write: WriteRun, tmp_path: Path
) -> None:
    write("first", 7, num_episodes=50, schemes=("hybrid", "jamming"), scenario="campus")
    (entry,) = RunIndex(tmp_path / "runs").entries()
    assert (entry.name, entry.scenario, entry.algorithm) == ("first", "campus", "ddpg")
    assert entry.schemes == ("hybrid", "jamming")
    assert (entry.learners, entry.episode, entry.num_episodes) == (2, 7, 50)
    assert entry.best == pytest.approx(0.6)


def test_runs_inside_other_runs_are_found_and_what_is_no_run_is_not(
    write: WriteRun, tmp_path: Path
) -> None:
    write("job", 1)
    write("job/as_in_paper", 1)
    write("compared/shards/ddpg_T10", 1)
    (tmp_path / "runs" / "compared" / "config.yaml").write_text("learners: 10\n")
    names = {entry.name for entry in RunIndex(tmp_path / "runs").entries()}
    assert names == {"job", "job/as_in_paper", "compared/shards/ddpg_T10"}


def test_a_training_runs_until_its_last_episode_or_until_it_falls_silent(
    write: WriteRun, tmp_path: Path
) -> None:
    write("finished", 8, num_episodes=8)
    write("cut", 3)
    entries = {entry.name: entry for entry in RunIndex(tmp_path / "runs").entries()}
    now = time.time()
    assert entries["finished"].state(now) == "finished"
    assert entries["cut"].state(now) == "running"
    assert entries["cut"].state(now + RUNNING_SECONDS + 1) == "stopped"


def test_the_list_and_the_metrics_follow_a_file_that_grows(write: WriteRun, tmp_path: Path) -> None:
    path = write("growing", 3) / "metrics.csv"
    index = RunIndex(tmp_path / "runs")
    assert (index.entries()[0].episode, len(index.metrics("growing"))) == (3, 3)
    with path.open("a") as file:
        file.write(metrics_row(4) + "\n" + metrics_row(5)[:6])
    assert (index.entries()[0].episode, len(index.metrics("growing"))) == (4, 4)


def test_as_many_runs_as_can_be_drawn_are_parsed_once(
    write: WriteRun, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    names = [f"run_{number:02}" for number in range(MOST_DRAWN)]
    for name in names:
        write(name, 2)
    parsed: list[bytes] = []

    def parse(lines: bytes, columns: list[str]) -> pd.DataFrame:
        parsed.append(lines)
        return parse_rows(lines, columns)

    monkeypatch.setattr("hyuav.experiments.metrics.parse_rows", parse)
    index = RunIndex(tmp_path / "runs")
    first = [index.metrics(name) for name in names]
    assert len(parsed) == MOST_DRAWN
    assert all(rows is index.metrics(name) for name, rows in zip(names, first, strict=True))
    assert len(parsed) == MOST_DRAWN


def test_the_training_of_a_comparison_has_one_name_before_and_after_its_end(
    write: WriteRun, tmp_path: Path
) -> None:
    unfinished = write("compared/shards/ddpg_T10.partial", 3)
    index = RunIndex(tmp_path / "runs")
    (entry,) = index.entries()
    assert entry.name == "compared/shards/ddpg_T10"
    assert len(index.metrics(entry.name)) == 3
    assert index.configuration(entry.name)["algorithm"]["name"] == "ddpg"
    finished = unfinished.rename(unfinished.with_suffix(""))
    assert len(index.metrics(entry.name)) == 3
    assert [own.name for own in index.entries()] == [entry.name]
    with (finished / "metrics.csv").open("a") as file:
        file.write(metrics_row(4) + "\n")
    assert len(index.metrics(entry.name)) == 4
    write("compared/shards/ddpg_T10.partial", 1)  # a directory of each name: none is hidden
    assert {own.name for own in index.entries()} == {entry.name, f"{entry.name}.partial"}
    assert len(index.metrics(f"{entry.name}.partial")) == 1


def test_evaluations_apart_from_a_run_are_found(write: WriteRun, tmp_path: Path) -> None:
    job = write("job", 1)
    for directory in (job, job / "horizons" / "T10", tmp_path / "runs" / "apart"):
        directory.mkdir(parents=True, exist_ok=True)
        (directory / "flights.parquet").write_bytes(b"flights")
    index = RunIndex(tmp_path / "runs")
    assert index.evaluations() == ["apart", "job/horizons/T10"]
    assert [entry.name for entry in index.entries()] == ["job"]


def test_the_newest_run_comes_first(write: WriteRun, tmp_path: Path) -> None:
    for age, name in ((300, "a"), (100, "b"), (200, "c")):
        begun = time.time() - age
        os.utime(write(name, 1) / "config.yaml", (begun, begun))
    assert [entry.name for entry in RunIndex(tmp_path / "runs").entries()] == ["b", "c", "a"]


def test_three_hundred_runs_are_listed_and_found_by_words(write: WriteRun, tmp_path: Path) -> None:
    for number in range(300):
        scenario = "campus" if number % 3 == 0 else "two_clusters"
        write(f"run_{number:03}", 2 + number % 5, scenario=scenario)
    entries = RunIndex(tmp_path / "runs").entries()
    assert len(entries) == 300
    found = [entry.name for entry in entries if entry.matches(["CAMPUS", "_01"])]
    assert sorted(found) == ["run_012", "run_015", "run_018"]


@pytest.mark.parametrize("made", [False, True])
def test_a_directory_without_runs_has_none(tmp_path: Path, made: bool) -> None:
    if made:
        (tmp_path / "runs").mkdir()
    assert RunIndex(tmp_path / "runs").entries() == []


DAMAGED = {
    "empty": b"",
    "no yaml": b"{]: \x00",
    "a list": b"- 1\n- 2\n",
    "other types": b"scenario: 3\nalgorithm: {name: [1]}\nlearners: [4, {scheme: {}}]\ntraining: x",
    "a tag": b"scenario: !!python/object/apply:os.system ['true']\n",
}


@pytest.mark.parametrize("content", DAMAGED.values(), ids=DAMAGED.keys())
def test_a_run_with_a_damaged_configuration_is_still_listed(
    write: WriteRun, tmp_path: Path, content: bytes
) -> None:
    (write("damaged", 4) / "config.yaml").write_bytes(content)
    (entry,) = RunIndex(tmp_path / "runs").entries()
    assert (entry.scenario, entry.algorithm, entry.episode) == ("unknown", "unknown", 4)


@pytest.mark.parametrize("content", [b"", b"episode", b"a,b\n1,2\n", b"\xff\0\n\xff"])
def test_a_run_without_readable_metrics_is_still_listed(
    write: WriteRun, tmp_path: Path, content: bytes
) -> None:
    (write("begun", 1) / "metrics.csv").write_bytes(content)
    (entry,) = RunIndex(tmp_path / "runs").entries()
    assert (entry.episode, entry.best) == (0, None)


@pytest.mark.parametrize(
    "name", ["..", "../outside", "/etc", "run/../../outside", "no\0where", "x"]
)
def test_no_name_leads_out_of_the_directory(write: WriteRun, tmp_path: Path, name: str) -> None:
    write("run", 1)
    write("../outside", 1)
    with pytest.raises(InputError, match=r"run = "):
        RunIndex(tmp_path / "runs").metrics(name)


def test_no_symbolic_link_leads_out_of_the_directory(write: WriteRun, tmp_path: Path) -> None:
    outside = write("../outside", 3)
    inside = write("inside", 3)
    index = RunIndex(tmp_path / "runs")
    (tmp_path / "runs" / "linked").symlink_to(outside)
    (inside / "evaluation.json").symlink_to(outside / "config.yaml")
    (inside / "checkpoints").symlink_to(outside)
    assert [entry.name for entry in index.entries()] == ["inside"]
    assert not index.has("inside", "evaluation.json")
    for read in (lambda: index.metrics("linked"), lambda: index.run("inside")):
        with pytest.raises(InputError, match=r"expected a (path|run) below"):
            read()


def test_the_references_of_an_evaluation_are_read(trained_runs: Path) -> None:
    references = RunIndex(trained_runs).references("tiny")
    assert set(references) == {"hybrid", "relay", "jamming", "no_helper"}
    assert references["no_helper"] > references["hybrid"] >= references["relay"] > 0


@pytest.mark.parametrize("content", ['{"schemes": {"optimum": 3}}', '{"schemes": {"optimum"'])
def test_a_damaged_or_foreign_evaluation_is_refused(
    write: WriteRun, tmp_path: Path, content: str
) -> None:
    file = write("run", 1) / "evaluation.json"
    index = RunIndex(tmp_path / "runs")
    assert index.references("run") == {}
    file.write_text(content)
    with pytest.raises(InputError, match=r"evaluation\.json: expected an evaluation in JSON"):
        index.references("run")
