"""Fly saved runs beside the reference schemes and the optimum.

hyuav evaluate run=runs/NAME
hyuav evaluate run=[runs/HYBRID,runs/RELAY,runs/JAMMING]
hyuav evaluate run=runs/NAME num_slots=10
hyuav evaluate run=runs/NAME scenario=random_disk
hyuav evaluate run=runs/SWEEP scenario.num_slots=10 scenario.jamming_power=0.2
"""

import hyuav._support.start  # noqa: F401 - first: the rest takes seconds to load

# isort: split

import os
from collections.abc import Sequence
from pathlib import Path

import torch
from pydantic.dataclasses import dataclass
from rich.console import Console

from hyuav._support.errors import InputError, rejection
from hyuav._support.files import require_writable
from hyuav._support.parameters import (
    Count,
    OneOrMore,
    Parameters,
    Text,
    Threads,
    ZeroOrMore,
    parameter,
)
from hyuav._support.terminal import make_progress, print_line
from hyuav.envs.rewards import REWARDS
from hyuav.experiments.configuration import Config, given, recipe, section
from hyuav.experiments.elsewhere import AS_TRAINED, destination, runs_in
from hyuav.experiments.evaluation import (
    EVALUATION_FILE,
    FLIGHTS_FILE,
    EvaluationParameters,
    evaluate,
)
from hyuav.experiments.evaluation_table import print_results
from hyuav.experiments.own_code import OwnAlgorithm
from hyuav.experiments.policies import learned_policies, references
from hyuav.experiments.run_directory import RunDirectory
from hyuav.experiments.tracking import EvaluationLoggerParameters, log_evaluation
from hyuav.viz.html.page import write_report
from hyuav.viz.paper.flights import save_flight_map


@dataclass(frozen=True)
class Evaluate(Parameters):
    """What to evaluate and where to."""

    run: OneOrMore[Text] | None = parameter(None)
    """Directories of runs; that of a sweep or of a comparison stands for the runs in it."""
    num_slots: Count | None = parameter(None, symbol="T")
    """The horizon that the learners were trained for; None for their scenario's where some were, or
    else for the longest."""
    output: Text | None = parameter(None)
    """Directory for what comes of it; None for the run's, and in it one for each further horizon
    and for each other scenario."""
    algorithm: ZeroOrMore[OwnAlgorithm] = parameter(())
    """The runs' own algorithms; a run's directory names a file, but only you let it be run."""
    reward: Text | None = parameter(None)
    """By which to evaluate, a name or FILE.py:NAME; the first run's own where it is None."""
    device: Text = parameter("cpu")
    threads: Threads = parameter(1)


@recipe(
    "evaluate",
    Evaluate,
    groups={"scenario": AS_TRAINED, "logger": AS_TRAINED},
    sections={"evaluation": EvaluationParameters},
    run_directory=".",
)
def main(config: Config, _: Path) -> None:
    """Evaluate, print the table, and keep it in the first run's directory."""
    options = section(config, Evaluate)
    parameters = EvaluationParameters.from_dict(config["evaluation"])
    logger = EvaluationLoggerParameters.from_dict(config["logger"])
    if options.run is None:
        raise InputError("run is missing: expected run=DIRECTORY, or run=[DIRECTORY,...]")
    torch.set_num_threads(options.threads)
    runs = [run for path in options.run for run in runs_in(path)]
    if len({os.path.realpath(run.path) for run in runs}) < len(runs):
        raise InputError(rejection("run", list(options.run), "different run directories"))
    trained = [run.configuration().reward for run in runs]
    for run, own in zip(runs, trained, strict=True):
        if options.reward is None and own != trained[0]:
            accepted = f"the reward of {runs[0].path}, or reward=NAME for all"
            raise InputError(rejection("run", str(run.path), accepted))
    reward = trained[0] if options.reward is None else REWARDS.find(options.reward)
    flown = destination(
        runs,
        config["scenario"],
        options.num_slots,
        keeps_horizon="scenario.num_slots" not in given(),
    )
    console, scenario = Console(), flown.scenario
    learned = learned_policies(runs, scenario, num_slots=flown.num_slots)
    tell_who_flies(runs, flown.num_slots, console)
    first = Path(options.run[0])
    kept = first if runs[0].path == first else first / "evaluation"
    output = Path(options.output or flown.directory(RunDirectory(kept)))
    require_writable("output", output / "figures")
    for name in (EVALUATION_FILE, FLIGHTS_FILE):
        if (output / name).is_dir():
            raise InputError(rejection(name, str(output / name), "a file or none, not a directory"))
    beside = references(scenario, parameters.resolution, console, reward)
    policies = {**learned, **beside}
    with make_progress(console, "evaluating") as progress:
        evaluation = evaluate(
            scenario,
            flown.name,
            policies,
            parameters,
            options.device,
            track=progress.track,
            reward=reward,
        )
    evaluation.save(output)
    save_flight_map(scenario, evaluation.flights, output / "figures")
    print_results(evaluation, console)
    report = write_report(output)
    log_evaluation(output, evaluation, runs, logger, console)
    print_line(f"evaluation: {output}", console)
    print_line(f"its report: {report.name}", console)


def tell_who_flies(runs: Sequence[RunDirectory], num_slots: int, console: Console) -> None:
    """Say what of several runs is left out, and which algorithms count as one scheme."""
    configurations = {run.path: run.configuration() for run in runs}
    fly = {
        path: own.algorithm_name
        for path, own in configurations.items()
        if num_slots in own.horizons
    }
    left_out = [str(path) for path in configurations if path not in fly]
    if left_out:
        print_line(f"without learners for T = {num_slots}: {', '.join(left_out)}", console)
    if len(algorithms := sorted(set(fly.values()))) > 1:
        print_line(f"learners of {', '.join(algorithms)} count together", console)


if __name__ == "__main__":
    main()
