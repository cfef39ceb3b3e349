"""The process in which one entry of the benchmark lives; run as a script by its path.

It reads commands and writes answers, one JSON object per line: ``start`` builds an entry and
warms it up, ``run`` lets it advance for a while, ``job`` takes it from nothing to the end, and
``stop`` asks for the peak memory.
"""

import importlib
import importlib.util
import json
import math
import os
import sys
import time
import types
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from benchmarks.work import Loop

ENTRIES = {
    "hyuav": ("own", "OwnTraining"),
    "hyuav_again": ("own", "OwnTraining"),
    "hyuav_robust": ("own", "OwnRobustTraining"),
    "stable_baselines3": ("stable_baselines", "StableBaselines3"),
    "sbx": ("stable_baselines", "SBX"),
    "cleanrl": ("cleanrl", "SingleFile"),
    "torchrl": ("torchrl_loop", "TorchRLLoop"),
    "make_env": ("environments", "LearnersEnvironment"),
    "compiled_env": ("environments", "CompiledEnvironment"),
    "numpy": ("environments", "NumpyFlights"),
    "random_numbers": ("environments", "RandomNumbers"),
    "five_schemes": ("references", "FiveSchemes"),
    "optima": ("references", "Optima"),
}
"""Where each entry is found: module of this package, and class."""

PEERS = ("stable_baselines3", "sbx", "cleanrl", "torchrl", "numpy", "random_numbers")
"""Entries that need nothing of this project but the scenario."""

LIBRARIES = {"stable_baselines3": ("stable_baselines3",), "sbx": ("sbx", "jax")}
"""What an entry imports beyond what this project itself needs."""


def import_entry(name: str) -> Any:
    """Import the class of an entry and the libraries it stands on."""
    if name in PEERS:
        _leave_out_this_project()
    for library in LIBRARIES.get(name, ()):
        importlib.import_module(library)
    module, entry = ENTRIES[name]
    return getattr(importlib.import_module(f"benchmarks.{module}"), entry)


def _leave_out_this_project() -> None:
    """Find this package's modules without importing the package, which imports TorchRL.

    A peer's start-up time and memory shall be its own.
    """
    found = importlib.util.find_spec("hyuav")
    assert found is not None
    package = types.ModuleType("hyuav")
    package.__path__ = list(found.submodule_search_locations or ())
    sys.modules["hyuav"] = package


def start(entry: Any, command: dict[str, Any]) -> "tuple[Loop, dict[str, Any]]":
    """Build the entry and let it advance until nothing is left to compile or to allocate."""
    from benchmarks.work import Work

    begun, slots = time.perf_counter(), 0
    loop: Loop = entry(Work.from_dict(command["work"]))
    built = time.perf_counter()
    while slots < loop.warm_up_slots:
        slots += loop.advance()
    warm = time.perf_counter()
    return loop, {"build_seconds": built - begun, "warm_up_seconds": warm - built}


def run(loop: "Loop", seconds: float) -> dict[str, Any]:
    """Advance for about ``seconds``; count the steps of all learners or helpers together."""
    slots, begun = 0, time.perf_counter()
    while (elapsed := time.perf_counter() - begun) < seconds:
        slots += loop.advance()
    return {"steps": slots * loop.width, "seconds": elapsed}


def job(entry: Any, command: dict[str, Any]) -> dict[str, Any]:
    """Train for as many episodes as the work has."""
    from benchmarks.work import Work

    work = Work.from_dict(command["work"])
    loop: Loop = entry(work)
    slots = 0
    while slots < work.episodes * work.scenario.num_slots:
        slots += loop.advance()
    return {"slots": slots}


def peak_memory() -> dict[str, Any]:
    """The most memory that this process has held, in MiB; on a GPU too, where it used one."""
    peaks = {"peak_mebibytes": _peak_bytes() / 2**20}
    torch = sys.modules.get("torch")
    if torch is not None and torch.cuda.is_initialized():
        peaks["peak_gpu_mebibytes"] = torch.cuda.max_memory_allocated() / 2**20
    return peaks


def _peak_bytes() -> float:
    """NaN where the system does not tell."""
    status = Path("/proc/self/status")
    if status.exists():  # Linux's getrusage would count what the parent held when it forked
        lines = status.read_text(encoding="utf-8").splitlines()
        (peak,) = (line.split()[1] for line in lines if line.startswith("VmHWM"))
        return int(peak) * 2**10
    try:
        import resource
    except ImportError:
        return math.nan
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def main(name: str) -> None:
    """Obey commands until told to stop."""
    answers = os.fdopen(os.dup(1), "w", buffering=1)
    sys.path[0] = str(Path(__file__).parents[1])  # not this folder, whose modules have short names
    os.dup2(2, 1)  # whatever a library prints must not be taken for an answer
    try:
        entry = import_entry(name)
        print(json.dumps({"ready": True}), file=answers)
        loop = None
        for line in sys.stdin:
            command = json.loads(line)
            match command["do"]:
                case "start":
                    loop = None  # two batches at once might not fit
                    loop, answer = start(entry, command)
                case "run":
                    assert loop is not None
                    answer = run(loop, command["seconds"])
                case "job":
                    answer = job(entry, command)
                case _:
                    print(json.dumps(peak_memory()), file=answers)
                    return
            print(json.dumps(answer), file=answers)
    except Exception as error:
        reason = f"{type(error).__name__}: {' '.join(str(error).split())}"
        print(json.dumps({"error": reason}), file=answers)
        raise


if __name__ == "__main__":
    main(sys.argv[1])
