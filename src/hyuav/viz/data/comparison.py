"""What a comparison of algorithms shows, and how each algorithm looks in its pictures."""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from hyuav._support.errors import InputError
from hyuav.envs.appearance import OKABE_ITO
from hyuav.experiments.comparison.plan import LAYOUT, PIECES, Compare
from hyuav.experiments.comparison.shards import CURVES_FILE, RESULTS_FILE
from hyuav.experiments.comparison.statistics import performance_profiles
from hyuav.experiments.run_directory import RunConfiguration, RunDirectory
from hyuav.learning.registry import ALGORITHMS, GENERALIST, PEER
from hyuav.viz.data.reading import readable_config, readable_table

_OTHERS = ("bluish green", "blue", "orange", "reddish purple", "sky blue", "yellow", "black")

_BESIDE = {PEER: OKABE_ITO["vermillion"], GENERALIST: "#b0b0b0"}
"""Of what is compared and no algorithm of this project."""

_UNKNOWN = "#777777"
"""Of an algorithm or a piece that is not offered now: another user's own, an earlier version's."""

_IDENTITY = {"algorithm", "scenario", "scheme", "num_slots", "seed"}
_RESULTS = {"fraction", "episodes_to_threshold", "seconds_to_threshold", "seconds"} | _IDENTITY
_CURVES = {"episode", "fraction"} | _IDENTITY


def entry_color(entry: str) -> str:
    """An entry's color in every figure; a variant without a piece has that of the piece."""
    if entry in _BESIDE:
        return _BESIDE[entry]
    piece = entry.partition("-")[2]
    name, known = (piece, PIECES) if piece else (entry, tuple(ALGORITHMS))
    return OKABE_ITO[_OTHERS[known.index(name) % len(_OTHERS)]] if name in known else _UNKNOWN


def entry_line(entry: str) -> int:
    """Which line and marker tell an entry from others of its color; 0 of a whole algorithm."""
    piece = entry.partition("-")[2]
    return 1 + PIECES.index(piece) // len(_OTHERS) if piece in PIECES else 0


def is_comparison(directory: Path) -> bool:
    """Whether a directory holds a comparison, however much of it is there yet, and no run."""
    begun = (directory / "shards").is_dir() or (directory / RESULTS_FILE).is_file()
    return begun or "hyperparameters" in readable_config(directory)


def profiles(results: pd.DataFrame) -> pd.DataFrame:
    """The share of learners that reach each share of the optimum, from where some do not.

    Args:
        results: a row for each learner, as :class:`.comparison.directory.Summary` holds them.

    Returns:
        as :func:`.statistics.performance_profiles`.
    """
    lowest = max(math.floor(20 * results["fraction"].min()) / 20, 0.0)
    return performance_profiles(results, np.linspace(min(lowest, 0.95), 1.0, 101))


class TrainedEntry(NamedTuple):
    """A finished training of a comparison, whose weights are kept."""

    entry: str
    """What is compared."""
    run: RunDirectory
    configuration: RunConfiguration


class ReadableComparison:
    """What the directory of a comparison tells, however much of it is there yet.

    Args:
        directory: of the comparison.
    """

    def __init__(self, directory: Path) -> None:
        self.directory, self.config = directory, readable_config(directory)
        value = self.config.get("threshold")
        self.threshold = 0.97
        if isinstance(value, int | float) and 0 <= value <= 1:
            self.threshold = float(value)
        self._asked = _asked(self.config)

    @property
    def results(self) -> pd.DataFrame | None:
        """A row for each learner of the finished trainings, or of what was gathered of them."""
        return self._rows(RESULTS_FILE, _RESULTS)

    @property
    def curves(self) -> pd.DataFrame | None:
        """A row for each of their evaluations in training."""
        return self._rows(CURVES_FILE, _CURVES)

    def trained(self) -> list[TrainedEntry]:
        """The finished trainings: the longest horizons first, and presets before layouts."""
        found = []
        for path in self._finished():
            run = RunDirectory(path)
            try:
                configuration = run.configuration()
            except InputError:
                continue
            horizon = f"_T{configuration.scenario.num_slots}"
            entry = path.name.partition(f"_{configuration.scenario_name}{horizon}")[0]
            if run.best_checkpoint.is_file():
                found.append(TrainedEntry(entry, run, configuration))
        return sorted(found, key=self._flown)

    def _rows(self, name: str, columns: set[str]) -> pd.DataFrame | None:
        paths = [path / name for path in self._finished()] or [self.directory / name]
        read = (readable_table(path, columns) for path in paths)
        tables = sorted((table for table in read if table is not None), key=self._place)
        return pd.concat(tables, ignore_index=True) if tables else None

    def _finished(self) -> list[Path]:
        return sorted(path.parent for path in self.directory.glob(f"shards/*/{RESULTS_FILE}"))

    def _place(self, table: pd.DataFrame) -> list[int]:
        """By which the tables of trainings are sorted."""
        first = table[["algorithm", "scenario", "num_slots"]].iloc[0]
        return [_index(asked, own) for asked, own in zip(self._asked, first, strict=True)]

    def _flown(self, trained: TrainedEntry) -> tuple[Any, ...]:
        """By which the flights of trainings are sorted."""
        entries, scenarios, _ = self._asked
        name = trained.configuration.scenario_name
        return (
            name.startswith(LAYOUT),
            -trained.configuration.scenario.num_slots,
            _index(scenarios, name),
            name,
            _index(entries, trained.entry),
        )


def _asked(config: Mapping[str, Any]) -> tuple[Sequence[Any], Sequence[Any], Sequence[Any]]:
    """The entries, scenarios and horizons of a comparison, in the order that was asked for.

    None where its ``config.yaml`` is damaged or of another version.
    """
    names = [field.name for field in dataclasses.fields(Compare)]
    try:
        asked = Compare.from_dict({name: config[name] for name in names if name in config})
    except InputError:
        return (), (), ()
    return asked.entries, asked.scenario, asked.num_slots


def _index(values: Sequence[Any], value: object) -> int:
    """The place among what was asked for; what is unknown comes last."""
    told = [str(own) for own in values]
    return told.index(str(value)) if str(value) in told else len(told)
