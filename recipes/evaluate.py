"""Fly saved runs beside the reference schemes and the optimum.

hyuav evaluate run=runs/NAME
hyuav evaluate run=[runs/HYBRID,runs/RELAY,runs/JAMMING]
hyuav evaluate run=runs/NAME num_slots=10
"""

import hyuav._support.start  # noqa: F401 - first: the rest takes seconds to load

# isort: split

import dataclasses
import os
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
from hyuav.experiments.configuration import Config, recipe, section
from hyuav.experiments.evaluation import (
    EVALUATION_FILE,
    FLIGHTS_FILE,
    EvaluationParameters,
    evaluate,
)
from hyuav.experiments.evaluation_table import print_results
from hyuav.experiments.own_code import OwnAlgorithm
from hyuav.experiments.policies import learned_policies, reference_policies
from hyuav.experiments.run_directory import RunDirectory
from hyuav.experiments.tracking import EvaluationLoggerParameters, log_evaluation
from hyuav.viz.html.page import write_report
from hyuav.viz.paper.flights import save_flight_map


@dataclass(frozen=True)
class Evaluate(Parameters):
    """What to evaluate and where to."""

    run: OneOrMore[Text] | None = parameter(None)
    num_slots: Count | None = parameter(None, symbol="T")
    """The horizon, of whose learners the runs must have some; the scenario's where it is None."""
    output: Text | None = parameter(None)
    algorithm: ZeroOrMore[OwnAlgorithm] = parameter(())
    """The runs' own algorithms; a run's directory names a file, but only you let it be run."""
    reward: Text | None = parameter(None)
    """By which to evaluate, a name or FILE.py:NAME; the first run's own where it is None."""
    device: Text = parameter("cpu")
    threads: Threads = parameter(1)


@recipe(
    "evaluate",
    Evaluate,
    groups={},
    sections={"evaluation": EvaluationParameters, "logger": EvaluationLoggerParameters},
    run_directory=".",
)
def main(config: Config, _: Path) -> None:
    """Evaluate, print the table, and keep it beside the first run's other files."""
    options = section(config, Evaluate)
    parameters = EvaluationParameters.from_dict(config["evaluation"])
    logger = EvaluationLoggerParameters.from_dict(config["logger"])
    if options.run is None:
        raise InputError("run is missing: expected run=DIRECTORY, or run=[DIRECTORY,...]")
    torch.set_num_threads(options.threads)
    runs = [RunDirectory(path) for path in options.run]
    first = runs[0].configuration()
    if len({os.path.realpath(path) for path in options.run}) < len(runs):
        raise InputError(rejection("run", list(options.run), "different run directories"))
    for run in runs[1:]:
        if run.configuration().scenario != first.scenario:
            raise InputError(rejection("run", str(run.path), f"the scenario of {runs[0].path}"))
        if options.reward is None and run.configuration().reward != first.reward:
            accepted = f"the reward of {runs[0].path}, or reward=NAME for all"
            raise InputError(rejection("run", str(run.path), accepted))
    scenario = first.scenario
    if options.num_slots is not None:
        scenario = dataclasses.replace(scenario, num_slots=options.num_slots)
    reward = first.reward if options.reward is None else REWARDS.find(options.reward)
    console = Console()
    output = runs[0].path if options.output is None else Path(options.output)
    learned = learned_policies(runs, scenario)
    require_writable("output", output / "figures")
    for name in (EVALUATION_FILE, FLIGHTS_FILE):
        if (output / name).is_dir():
            raise InputError(rejection(name, str(output / name), "a file or none, not a directory"))
    references = reference_policies(scenario, parameters.resolution, console, reward)
    policies = {**learned, **references}
    with make_progress(console, "evaluating") as progress:
        evaluation = evaluate(
            scenario,
            first.scenario_name,
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


if __name__ == "__main__":
    main()
