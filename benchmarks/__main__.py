"""Measure how fast this project is beside its peers, on this machine.

pip install 'hyuav[bench]'
hyuav benchmark
hyuav benchmark parts=training learners=[1,10,30] seconds=20
hyuav benchmark quick=true
"""

import hyuav._support.start  # noqa: F401 - first: the rest takes seconds to load

# isort: split

from pathlib import Path

from rich.console import Console

from benchmarks.arithmetic import matrix_rate
from benchmarks.charts import draw
from benchmarks.machine import facts
from benchmarks.parts import MEASURE
from benchmarks.plan import Benchmark, devices, require_peers
from benchmarks.results import Results
from benchmarks.tables import print_tables
from hyuav._support.files import require_writable
from hyuav._support.machine import cores
from hyuav._support.terminal import print_line
from hyuav.experiments.configuration import Config, recipe, section
from hyuav.experiments.scenarios import named_scenario


@recipe(
    "benchmark",
    Benchmark,
    groups={"scenario": "two_clusters"},
    sections={},
    run_directory="runs/${now:%Y-%m-%d_%H-%M-%S}_benchmark",
)
def main(config: Config, directory: Path) -> None:
    """Measure part after part; print the tables, keep the numbers, draw the figures."""
    plan = section(config, Benchmark).shortened()
    _, scenario = named_scenario(config["scenario"])
    require_peers(plan.parts, plan.peers)
    require_writable("run directory", directory)
    console = Console()
    rates = {device: matrix_rate(cores(), device) for device in devices()}
    results = Results(facts(), rates, [])
    for part in plan.parts:
        with console.status(part) as status:
            results.rows.extend(MEASURE[part](plan, scenario, status.update))
        results.save(directory)  # so that a part that fails later takes none with it
    print_tables(results, console)
    draw(results, directory / "figures")
    print_line(f"benchmark: {directory}", console)


if __name__ == "__main__":
    main()
