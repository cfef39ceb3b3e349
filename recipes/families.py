"""Fly the generalist in many scenarios that it has never seen.

hyuav families family=one
hyuav families family=two scenarios=50 output=runs/two
"""

import hyuav._support.start  # noqa: F401 - first: the rest takes seconds to load

# isort: split

from pathlib import Path

import pandas as pd
from rich.console import Console

from hyuav._support.formatting import percent
from hyuav._support.terminal import print_line, print_table, results_table
from hyuav.experiments.command_line import same_call
from hyuav.experiments.configuration import Config, recipe, section, telling_how_to_go_on
from hyuav.experiments.families import (
    TABLE_FILE,
    Families,
    FamiliesDirectory,
    distribution,
    fractions,
)
from hyuav.experiments.fly import fly
from hyuav.physics.scenario_families import family
from hyuav.viz.paper.families import families_figure
from hyuav.viz.paper.flights import save_flight_map
from hyuav.viz.paper.style import save_figure

BY = {
    None: "all",
    "power_control": "power control",
    "mode_rule": "",
    "num_helpers": "helpers",
    "num_ues": "UEs",
    "num_slots": "slots",
}
"""What the fractions are told by, after all of them together, and its name in the table."""

WORST = 5
"""Scenarios that are named."""


@recipe("families", Families, groups={}, sections={}, run_directory="${output}")
def main(config: Config, directory: Path) -> None:
    """Fly what is left, and print how the fractions are distributed."""
    options, console = section(config, Families), Console()
    with telling_how_to_go_on(*same_call("output", directory)):
        table = FamiliesDirectory(directory, config, options).complete(console)
    own = fractions(table)
    title = (
        f"family {options.family}, % of the optimum; left out are "
        f"{len(table) - len(own)} scenarios in which it brings next to nothing"
    )
    columns = ("refined\nmean", "5th per-\ncentile", "worst")
    shown = results_table(title, "", "scena-\nrios", "mean", "5th per-\ncentile", "worst", *columns)
    for by, named in BY.items():
        for _, row in distribution(own, by).iterrows():
            cells = (
                percent(row[f"{name}_{what}"], 2 if what == "mean" else 1).rstrip(" %")
                for name in ("generalist", "refined")
                for what in ("mean", "p5", "worst")
            )
            value = row["value"] if by else ""
            shown.add_row(f"{named} {value}".strip(), str(row["scenarios"]), *cells)
    print_table(shown, console)
    tell_worst(own, console)
    save_figure(families_figure(own), directory, "families")
    for seed in own.nsmallest(options.drawn, "generalist_fraction")["seed"]:
        scenario, _ = family(options.family, int(seed), options.split)
        flown = fly(scenario, episodes=options.episodes, seed=int(seed))
        save_flight_map(scenario, flown.flights, directory / "worst", f"seed_{seed}")
    print_line(f"all scenarios: {directory / TABLE_FILE}", console)


def tell_worst(own: pd.DataFrame, console: Console) -> None:
    """Name the scenarios in which the generalist loses most."""
    worst = own.nsmallest(WORST, "generalist_fraction")
    told = ", ".join(
        f"{int(row['seed'])} ({percent(row['generalist_fraction'])})" for _, row in worst.iterrows()
    )
    print_line(f"worst seeds: {told}", console)
    seconds = own["seconds"].median(), own["seconds_refining"].median()
    print_line(f"seconds per flight, median: {seconds[0]:.2f}, to refine {seconds[1]:.2f}", console)


if __name__ == "__main__":
    main()
