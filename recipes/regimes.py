"""Map which scheme is best, and by how much, over two parameters.

hyuav regimes
hyuav regimes scenario=random_disk scenario.fading=false
hyuav regimes x.field=noise_power x.low=1e-15 x.high=1e-9
hyuav regimes y.field=eavesdropper_altitude y.low=40 y.high=140 x.points=40
hyuav regimes output=runs/NAME
"""

import hyuav._support.start  # noqa: F401 - first: the rest takes seconds to load

# isort: split

import sys
from functools import partial
from pathlib import Path

import torch
from rich.console import Console

from hyuav._support.errors import InputError, harmless, rejection
from hyuav._support.formatting import percent
from hyuav._support.terminal import print_line, print_table, results_table
from hyuav.experiments.command_line import same_call
from hyuav.experiments.configuration import (
    Config,
    given,
    recipe,
    section,
    telling_how_to_go_on,
)
from hyuav.experiments.regimes.plan import Axes, Axis, Regimes
from hyuav.experiments.regimes.work import RegimeDirectory
from hyuav.experiments.scenarios import named_scenario
from hyuav.viz.data.regimes import LABELS, RegimeMap, read_regimes, shares_table, times
from hyuav.viz.html.page import write_report
from hyuav.viz.paper.regimes import regimes_figure
from hyuav.viz.paper.style import save_figure


@recipe(
    "regimes",
    Regimes,
    groups={"scenario": "two_clusters"},
    sections={
        "x": Axis,
        "y": partial(Axis, "eavesdropper_distance", 0.0, 140.0, scale="linear"),
    },
    run_directory="${output}",
)
def main(config: Config, directory: Path) -> None:
    """Solve what is missing of the map; told to stop, say how to go on."""
    with telling_how_to_go_on(*same_call("output", directory)):
        regimes(config, directory)


def regimes(config: Config, directory: Path) -> None:
    """Solve what is missing, print the shares of the map, draw it and write its report."""
    options, axes = section(config, Regimes), section(config, Axes)
    require_range(config)
    torch.set_num_threads(1)
    _, scenario = named_scenario(config["scenario"])
    found = RegimeDirectory(directory, config, axes, scenario, options)
    console = Console()
    failures = found.complete(console)
    if not failures:
        shown = read_regimes(directory)
        print_shares(shown, console)
        save_figure(regimes_figure(shown), directory, "regimes")
        print_line(f"its report: {write_report(directory).name}", console)
    print_line(f"map: {directory}", console)
    for name, reason in failures.items():
        print(harmless(f"failed: {name}: {reason}"), file=sys.stderr)
    if failures:
        sys.exit(1)


def print_shares(shown: RegimeMap, console: Console) -> None:
    """Print on how much of the map each scheme is best, and by how much at most."""
    title = f"{shown.name}, {len(shown.rows)} points"
    table = results_table(
        title, "Best at fixed power", "share of\nthe map", "times the\nothers, most"
    )
    for _, row in shares_table(shown).iterrows():
        table.add_row(LABELS[row["best"]], percent(row["share"]), times(row["factor"]))
    print_table(table, console)


def require_range(config: Config) -> None:
    """Accept another field only with a range of its own.

    Raises:
        InputError: an axis has a field, and the range of the field that it had by default.
    """
    for axis in ("x", "y"):
        if f"{axis}.field" in given() and not {f"{axis}.low", f"{axis}.high"} <= given():
            accepted = f"{axis}.low=NUMBER and {axis}.high=NUMBER beside it"
            raise InputError(rejection(f"{axis}.field", config[axis]["field"], accepted))


if __name__ == "__main__":
    main()
