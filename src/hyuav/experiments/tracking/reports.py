"""What is logged of an evaluation and of a comparison: numbers, tables, figures, lineage."""

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd
from rich.console import Console

from hyuav.experiments.evaluation import Evaluation
from hyuav.experiments.run_directory import RunDirectory
from hyuav.experiments.schemes import LABELS
from hyuav.experiments.tracking.logged_run import Job
from hyuav.experiments.tracking.memory import model_name, remembered
from hyuav.experiments.tracking.parameters import (
    AS_TRAINED,
    LONGEST,
    TENSORBOARD,
    LoggerParameters,
)
from hyuav.experiments.tracking.session import Session


def log_evaluation(
    directory: Path,
    evaluation: Evaluation,
    runs: Sequence[RunDirectory],
    logger: LoggerParameters,
    console: Console,
) -> None:
    """Log an evaluation as a run of its own, beside those of the trainings that it evaluates.

    The table of the schemes, the flights, the figures and the report of the directory are its
    media. It uses the trainings' best checkpoints: online as artifacts; offline, where the library
    cannot, by their names in its configuration.

    Args:
        directory: of the evaluation.
        evaluation: to log.
        runs: of the trainings.
        logger: by which library, in which run. The mode "as_trained" is that of the first training,
            and nothing is logged where that was not.
        console: on which the end is told.
    """
    trained = [known for known in map(_training, runs) if known]
    logger = _beside(logger, trained[0] if trained else {})
    models = [
        f"{_project(known)}/{model_name(known['id'])}:best" for known in trained if "id" in known
    ]
    summary = evaluation.summary
    config = {
        "scenario": {"name": summary["scenario"], **summary["parameters"]},
        "evaluation": {name: summary[name] for name in ("num_slots", "episodes", "seed")},
        "models": models,
    }
    tables = {"schemes": _scheme_table(summary["schemes"]), "flights": evaluation.flights}
    with Session(Job(directory, config, "evaluate", models=models), logger, console) as session:
        session.attempt(lambda run: run.results(_results(summary["schemes"]), tables, directory))


def log_comparison(
    directory: Path,
    tables: Mapping[str, pd.DataFrame],
    config: Mapping[str, Any],
    logger: LoggerParameters,
    console: Console,
) -> None:
    """Log what a comparison has found so far, in the group of its trainings.

    Args:
        directory: of the comparison.
        tables: of its learners by name; the interquartile means of ``algorithms`` are its summary.
        config: all that was asked for.
        logger: by which library, in which run.
        console: on which the end is told.
    """
    logger = in_group(logger, directory)
    algorithms = tables["algorithms"]
    means = {
        f"{name}/iqm": float(value)
        for name, value in zip(algorithms["algorithm"], algorithms["iqm"], strict=True)
    }
    filled = {name: table for name, table in tables.items() if len(table)}
    with Session(Job(directory, config, "comparison", directory), logger, console) as session:
        session.attempt(lambda run: run.results(means, filled, directory))


def in_group(logger: LoggerParameters, directory: Path) -> LoggerParameters:
    """The same, in the group that is called as the directory where the logger names none."""
    group = logger.group or directory.resolve().name[-LONGEST:]
    return dataclasses.replace(logger, group=group)


def part_of(logger: LoggerParameters, job: Path, directory: Path) -> LoggerParameters:
    """The same for a training or an evaluation that a job keeps in a directory.

    Args:
        logger: of the whole job. An id that it asks for is that of the run in the job's directory.
        job: directory of the job, which its group is called as.
        directory: the job's or one within, which stands behind the job's in the name.
    """
    within = directory.resolve().relative_to(job.resolve())
    name = Path(logger.name or job.resolve().name, within).as_posix()
    of_job = in_group(logger, job)
    own_id = None if within.parts else logger.id
    return dataclasses.replace(of_job, name=name[-LONGEST:], id=own_id)


def _training(run: RunDirectory) -> dict[str, Any]:
    """Where a training was logged; empty if nowhere."""
    known = remembered(run.path)
    if known or not (run.path / TENSORBOARD).is_dir():
        return known
    return {"library": TENSORBOARD, "mode": "offline"}


def _beside(logger: LoggerParameters, training: Mapping[str, Any]) -> LoggerParameters:
    """The training's library, mode, project, entity and group, where others are not asked for."""
    known = {name: getattr(logger, name) or training.get(name) for name in ("entity", "group")}
    if logger.mode == AS_TRAINED:
        known["mode"] = training.get("mode", "disabled")
        known["project"] = training.get("project", logger.project)
        known["library"] = training.get("library", logger.library)
    return LoggerParameters.from_dict({**logger.to_dict(), **known})


def _project(training: Mapping[str, Any]) -> str:
    entity, project = training.get("entity"), training["project"]
    return f"{entity}/{project}" if entity else str(project)


def _scheme_table(schemes: Mapping[str, Mapping[str, Any]]) -> pd.DataFrame:
    """A row per scheme, as the terminal shows them."""
    rows = []
    for scheme, result in schemes.items():
        rate = result["secrecy_sum_rate"]
        own = {
            "scheme": LABELS[scheme],
            "secrecy_sum_rate": rate["mean"],
            "low": rate["ci95"][0],
            "high": rate["ci95"][1],
        }
        more = {name: value for name, value in result.items() if name not in own}
        if "reward" in more:
            more["reward"] = more["reward"]["mean"]
        rows.append(own | more)
    return pd.DataFrame(rows)


def _results(schemes: Mapping[str, Mapping[str, Any]]) -> dict[str, float]:
    """Of each scheme: mean secrecy sum-rate in bps/Hz, mean reward, fraction of the optimum.

    With several helpers the fraction of the upper bound too, and how each of them flew.
    """
    values = {}
    for scheme, result in schemes.items():
        values[f"{scheme}/secrecy_sum_rate"] = result["secrecy_sum_rate"]["mean"]
        if "reward" in result:
            values[f"{scheme}/reward"] = result["reward"]["mean"]
        values |= {
            f"{scheme}/{name}": value
            for name, value in result.items()
            if name in ("fraction_of_optimum", "fraction_of_upper_bound") or name[-1].isdigit()
        }
    return values
