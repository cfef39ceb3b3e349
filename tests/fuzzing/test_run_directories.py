"""Damaged run directories: reports and the dashboard's pages show what can be shown."""

import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hostile import CASES, PAYLOADS, TRIED, anything, attempt, fuzz, mutated, numbers, texts
from hyuav import InputError, Scenario
from hyuav.experiments.metrics import GrowingMetrics, readable_metrics
from hyuav.experiments.policies import learned_policies
from hyuav.experiments.run_directory import RunDirectory
from hyuav.viz.dashboard import curves
from hyuav.viz.dashboard.flights_page import kept_flights
from hyuav.viz.data.curves import last_results
from hyuav.viz.data.index import RunIndex
from hyuav.viz.data.reading import readable_evaluation, readable_flights
from hyuav.viz.html.curves import learning_figure
from hyuav.viz.html.page import write_report
from hyuav.viz.html.player import flight_player
from hyuav.viz.html.tables import scheme_table

pytest_plugins = "sample_runs"


def enough(kind: str) -> bool:
    return sum(TRIED[kind, outcome] for outcome in ("worked", "refused")) >= CASES[kind]


@pytest.fixture
def run(evaluated: RunDirectory, tmp_path: Path) -> RunDirectory:
    """A copy of an evaluated run, below a directory of runs."""
    return RunDirectory(shutil.copytree(evaluated.path, tmp_path / "runs" / "run"))


def draw_metrics(path: Path) -> None:
    """By the report and by the dashboard."""
    rows = readable_metrics(path)
    assert np.isfinite(rows["episode"]).all()
    learning_figure(rows)
    index = RunIndex(path.parent.parent)
    index.entries()
    metrics = {"run": GrowingMetrics(path).read()}
    curves.comparison(metrics, {}, curves.Choice())
    last_results(metrics, curves.Choice.y)


cells = (texts | numbers.map(str) | st.sampled_from(["hybrid", "relay", "1", "2", "10"])).map(
    lambda text: text[:400]
)


@pytest.mark.slow
def test_hostile_metrics_are_drawn_or_refused(run: RunDirectory) -> None:
    kind, path = "metrics", run.metrics_file
    whole = path.read_bytes()
    header = whole.partition(b"\n")[0].decode()
    width = len(header.split(","))
    rows = st.lists(st.lists(cells, min_size=width - 1, max_size=width), max_size=3).map(
        lambda lines: "\n".join([header, *(",".join(own) for own in lines), ""]).encode(
            errors="replace"
        )
    )

    @fuzz(kind)
    @given(rows | mutated(whole) | st.binary(max_size=100))
    def try_one(content: bytes) -> None:
        path.write_bytes(content)
        attempt(kind, lambda: draw_metrics(path))

    try_one()
    assert enough(kind)


def leaves(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """The paths to everything within nested values."""
    if not isinstance(value, dict):
        return [path]
    return [path, *(own for key, entry in value.items() for own in leaves(entry, (*path, key)))]


def replaced(value: Any, path: tuple[Any, ...], by: Any) -> Any:
    if not path:
        return by
    return {**value, path[0]: replaced(value[path[0]], path[1:], by)}


def show_evaluation(path: Path) -> None:
    summary = readable_evaluation(path.parent)
    if summary is not None:
        assert "<script" not in scheme_table(summary)
    index = RunIndex(path.parent.parent)
    optima = index.references(path.parent.name)
    assert all(np.isfinite(value) for value in optima.values())
    parameters = (index.evaluation(path.parent.name) or {}).get("parameters")
    if isinstance(parameters, dict):
        Scenario.from_dict(parameters)


@pytest.mark.slow
def test_a_hostile_evaluation_is_shown_or_refused(run: RunDirectory) -> None:
    kind, path = "evaluation", run.path / "evaluation.json"
    whole = path.read_bytes()
    content = json.loads(whole)
    finite = anything.filter(lambda value: not _has_bytes(value))
    changed = st.builds(
        lambda where, by: json.dumps(replaced(content, where, by)).encode(),
        st.sampled_from(leaves(content)),
        finite | texts,
    )
    renamed = st.builds(
        lambda name, account: json.dumps({**content, "schemes": {name: account}}).encode(),
        texts,
        st.just(content["schemes"]["optimum"]),
    )

    @fuzz(kind)
    @given(changed | renamed | mutated(whole) | st.sampled_from([b"[" * 10**5, b"9" * 5000]))
    def try_one(text: bytes) -> None:
        path.write_bytes(text)
        attempt(kind, lambda: show_evaluation(path))

    try_one()
    assert enough(kind)


def _has_bytes(value: Any) -> bool:
    if isinstance(value, dict):
        return any(_has_bytes(own) for own in value.values())
    if isinstance(value, list):
        return any(_has_bytes(own) for own in value)
    return isinstance(value, bytes) or (isinstance(value, int) and abs(value) > 10**4000)


def show_flights(path: Path, scenario: Scenario) -> None:
    flights = readable_flights(path.parent)
    state = path.stat()
    kept_flights.cache_clear()
    if flights is not None:
        flight_player(scenario, flights, flights["scheme"].iloc[0], flights["episode"].iloc[0])
    kept_flights(path.parent, (state.st_mtime_ns, state.st_size))


@pytest.mark.slow
def test_hostile_flights_are_shown_or_refused(run: RunDirectory) -> None:
    kind, path = "flights", run.path / "flights.parquet"
    whole, table = path.read_bytes(), pd.read_parquet(path).iloc[:12]
    scenario = run.configuration().scenario
    odd: list[Any] = [None, "x", "<script>", np.nan, np.inf, -1, 1e300, [1.0], [], True, 2**62]

    def with_column(name: str, value: Any) -> pd.DataFrame:
        return table.assign(**{name: [value] * len(table)})

    tabled = st.builds(with_column, st.sampled_from(list(table.columns)), st.sampled_from(odd))
    dropped = st.sampled_from(list(table.columns)).map(lambda name: table.drop(columns=name))

    @fuzz(kind)
    @given(mutated(whole) | tabled | dropped)
    def try_one(content: bytes | pd.DataFrame) -> None:
        if isinstance(content, bytes):
            path.write_bytes(content)
        else:
            content.to_parquet(path)
        attempt(kind, lambda: show_flights(path, scenario))

    try_one()
    assert enough(kind)


FILES = (
    *("config.yaml", "metrics.csv", "evaluation.json", "flights.parquet"),
    *("checkpoints/best.pt", "checkpoints", "figures"),
)
DAMAGES: dict[str, Callable[[Path], object]] = {
    "missing": lambda _: None,
    "empty": lambda path: path.write_bytes(b""),
    "a directory": lambda path: path.mkdir(),
    "a link to itself": lambda path: path.symlink_to(path.name),
    "a link to nowhere": lambda path: path.symlink_to("nowhere"),
    "a link to a device": lambda path: path.symlink_to("/dev/full"),
    "zeros": lambda path: path.write_bytes(bytes(5000)),
    "noise": lambda path: path.write_bytes(bytes(range(256)) * 20),
}


def damage(run: RunDirectory, name: str, how: str) -> None:
    path = run.path / name
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)
    if path.parent.is_dir():
        DAMAGES[how](path)


def use(run: RunDirectory) -> None:
    """Report on it, list it, and fly it as an evaluation would; the last may be refused."""
    report = write_report(run.path)
    assert report.read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
    index = RunIndex(run.path.parent)
    for entry in index.entries():
        index.configuration(entry.name)
    configuration = run.configuration()
    learned_policies([run], configuration.scenario)
    index.metrics(run.path.name)
    index.references(run.path.name)


@pytest.mark.slow
def test_a_damaged_run_directory_is_reported_on_or_refused(
    evaluated: RunDirectory, tmp_path: Path
) -> None:
    kind = "run directory"
    changes = st.dictionaries(
        st.sampled_from(FILES),
        st.sampled_from(sorted(DAMAGES)) | st.integers(0, 2**32),
        min_size=1,
        max_size=3,
    )

    @fuzz(kind)
    @given(changes, st.sampled_from(PAYLOADS))
    def try_one(damages: dict[str, str | int], payload: str) -> None:
        shutil.rmtree(tmp_path / "runs", ignore_errors=True)
        run = RunDirectory(shutil.copytree(evaluated.path, tmp_path / "runs" / "run"))
        for name, how in damages.items():
            path = run.path / name
            if isinstance(how, str):
                damage(run, name, how)
            elif path.is_file():
                place = how % path.stat().st_size
                content = path.read_bytes()
                new = payload.encode("utf-8", "surrogatepass")
                path.write_bytes(content[:place] + new + content[place + len(new) :])
        attempt(kind, lambda: use(run))

    try_one()
    assert enough(kind)


@pytest.mark.parametrize("how", sorted(DAMAGES))
@pytest.mark.parametrize("name", ["config.yaml", "metrics.csv"])
def test_a_file_that_is_none_ends_in_no_traceback(run: RunDirectory, name: str, how: str) -> None:
    damage(run, name, how)
    path = run.path / name
    attempt("damage", lambda: draw_metrics(run.metrics_file))
    if name == "config.yaml":
        with pytest.raises(InputError, match=r"^[^\n]+$"):
            run.configuration()
    elif path.exists():
        assert readable_metrics(path).empty


def test_a_pipe_is_not_waited_for(run: RunDirectory) -> None:
    for path in (run.path / "config.yaml", run.metrics_file, run.path / "evaluation.json"):
        path.unlink()
        os.mkfifo(path)
    with pytest.raises(InputError, match="not a file"):
        run.configuration()
    assert RunIndex(run.path.parent).configuration("run") == {}
    assert readable_evaluation(run.path) is None
    assert readable_metrics(run.metrics_file).empty
