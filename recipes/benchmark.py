"""Measure how fast this project is beside its peers, in one run and on this machine.

pip install 'hyuav[bench]'
python recipes/benchmark.py
python recipes/benchmark.py parts=training learners=[1,10,30] seconds=20
python recipes/benchmark.py quick=true
"""

import hyuav_start  # noqa: F401 - first: the rest takes seconds to load

from pathlib import Path

from rich.console import Console

from hyuav.benchmark.arithmetic import matrix_rate
from hyuav.benchmark.charts import draw
from hyuav.benchmark.machine import facts
from hyuav.benchmark.parts import MEASURE
from hyuav.benchmark.plan import Benchmark, devices, require_peers
from hyuav.benchmark.results import Results
from hyuav.benchmark.tables import print_tables
from hyuav.configuration import Config, recipe, section
from hyuav.recording import cores
from hyuav.runs import named_scenario, require_writable
from hyuav.terminal import print_line


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
