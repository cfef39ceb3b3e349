"""The page of a main job, whose learners have several horizons."""

import dataclasses
import re
from collections.abc import Callable
from typing import Any

import pandas as pd
import pytest
from rich.console import Console

from hyuav.experiments.elsewhere import horizon_directory
from hyuav.experiments.evaluation import Evaluation, EvaluationParameters, evaluate
from hyuav.experiments.policies import references
from hyuav.experiments.run_directory import RunDirectory
from hyuav.viz.html.document import Page, Section
from hyuav.viz.html.run import run_page

pytest_plugins = "sample_runs"

Copy = Callable[[RunDirectory], RunDirectory]


def _sections(page: Page) -> dict[str, Section]:
    return {section.title: section for section in page.sections}


@pytest.fixture(scope="module")
def shorter(trained: RunDirectory) -> Evaluation:
    """Over eight slots, where the run's own evaluation is over twelve."""
    scenario = dataclasses.replace(trained.configuration().scenario, num_slots=8)
    policies = references(scenario, 10.0, Console(quiet=True))
    return evaluate(scenario, "two_clusters", policies, EvaluationParameters(episodes=4, flights=1))


@pytest.fixture
def job(evaluated: RunDirectory, copied: Copy, shorter: Evaluation) -> RunDirectory:
    """The run with as many learners over eight slots, and their evaluation."""
    run = copied(evaluated)
    rows = run.metrics()
    further = rows.assign(num_slots=8, learner=rows["learner"] + 3)
    pd.concat([further, rows]).to_csv(run.metrics_file, index=False)
    shorter.save(horizon_directory(run, 8))
    return run


def test_each_horizon_has_its_optima_and_the_scenarios_own_comes_first(
    job: RunDirectory, shorter: Evaluation
) -> None:
    (picture,) = _sections(run_page(job.path))["Learning curves"].pictures
    names = [name for name in picture.figures if name.startswith("Accumulated reward")]
    assert names == ["Accumulated reward (bps/Hz), T = 12", "Accumulated reward (bps/Hz), T = 8"]
    assert next(iter(picture.figures)) == names[0]
    best = shorter.summary["schemes"]
    drawings: list[Any] = [picture.figures[name] for name in names]
    drawn = {shape.y0 for shape in drawings[1].layout.shapes}
    assert drawn == {best[name]["secrecy_sum_rate"]["mean"] for name in ("optimum", "re_optimum")}
    own = {shape.y0 for shape in drawings[0].layout.shapes}
    assert len(own) == 2
    assert min(own) > min(drawn)
    alone = best["no_helper"]["secrecy_sum_rate"]["mean"]
    named = {trace.name for trace in drawings[1].data}
    assert f"No helper: {alone:.4g}" in named


def test_each_horizon_has_a_table_and_flights(job: RunDirectory) -> None:
    sections = _sections(run_page(job.path))
    captions = [re.findall("<caption>T = (\\d+)", table) for table in sections["Schemes"].tables]
    assert captions == [["12"], ["8"]]
    (picture,) = sections["Flights"].pictures
    names = list(picture.figures)
    assert {"T = 12: Proposed", "T = 12: Optimum", "T = 8: Optimum", "T = 8: Re-LT"} <= set(names)
    assert names[0] == "T = 12: Proposed"
    assert not any("No helper" in name for name in names)
    assert len(picture.figures["T = 8: Optimum"]["frames"]) == 8


def test_a_damaged_evaluation_of_a_horizon_leaves_the_others(job: RunDirectory) -> None:
    (horizon_directory(job, 8) / "evaluation.json").write_text("{")
    sections = _sections(run_page(job.path))
    assert len(sections["Schemes"].tables) == 1
    assert "Proposed" in sections["Flights"].pictures[0].figures


def test_the_page_says_what_a_line_and_its_band_are(job: RunDirectory) -> None:
    notes = " ".join(_sections(run_page(job.path))["Learning curves"].notes)
    assert "interquartile mean over the learners of a scheme" in notes
    assert "95 % bootstrap interval" in notes
    assert "paper" not in notes
    as_in_paper = RunDirectory(job.path / "as_in_paper")
    as_in_paper.path.mkdir()
    job.metrics().to_csv(as_in_paper.metrics_file, index=False)
    notes = " ".join(_sections(run_page(job.path))["Learning curves"].notes)
    assert "thinner, paler lines are learned by the paper's own algorithm" in notes
