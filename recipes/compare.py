"""Compare algorithms on equal terms, each learner beside the optimum.

hyuav compare
hyuav compare algorithm=[ddpg,td3] scenario=two_clusters learners=5
hyuav compare scenario=[] layouts=50 learners=1
hyuav compare output=runs/NAME
hyuav compare learners=1000 engine=ray address=auto
"""

import hyuav._support.start  # noqa: F401 - first: the rest takes seconds to load

# isort: split

import sys
from functools import partial
from pathlib import Path

import torch
from rich.console import Console

from hyuav._support.errors import harmless
from hyuav._support.terminal import print_line
from hyuav.experiments.command_line import same_call
from hyuav.experiments.comparison.directory import ComparisonDirectory
from hyuav.experiments.comparison.plan import Compare, require_libraries
from hyuav.experiments.comparison.tables import print_tables
from hyuav.experiments.comparison.work import work_off
from hyuav.experiments.configuration import Config, recipe, section, telling_how_to_go_on
from hyuav.experiments.evaluation import EvaluationParameters
from hyuav.experiments.tracking import LoggerParameters, log_comparison
from hyuav.learning.training import TrainingParameters
from hyuav.viz.html.page import write_report
from hyuav.viz.paper.comparison import draw


@recipe(
    "compare",
    Compare,
    groups={"logger": "none"},
    sections={
        "training": partial(TrainingParameters, num_episodes=600, evaluation_every=5),
        "evaluation": EvaluationParameters,
    },
    run_directory="${output}",
)
def main(config: Config, directory: Path) -> None:
    """Do what is missing of the comparison; told to stop, say how to go on."""
    with telling_how_to_go_on(*same_call("output", directory)):
        compare(config, directory)


def compare(config: Config, directory: Path) -> None:
    """Train what is missing, print the tables, draw the figures."""
    options = section(config, Compare)
    require_libraries(options)
    torch.set_num_threads(1)
    comparison = ComparisonDirectory(directory, config, options)
    console = Console()
    failures = work_off(comparison, console)
    summary = comparison.summary()
    if summary is not None:
        summary.save(directory)
        print_tables(summary, options.threshold, console)
        draw(summary, options, directory / "figures")
        logger = LoggerParameters.from_dict(config["logger"])
        report = write_report(directory)
        log_comparison(directory, summary.tables, config, logger, console)
        print_line(f"its report: {report.name}", console)
    print_line(f"comparison: {directory}", console)
    for name, reason in failures.items():
        print(harmless(f"failed: {name}: {reason}"), file=sys.stderr)
    if failures:
        sys.exit(1)


if __name__ == "__main__":
    main()
