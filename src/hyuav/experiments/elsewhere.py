"""Trained actors flown again: of which runs, over which scenario, and where the result is kept."""

import dataclasses
import re
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hyuav._support.errors import InputError, rejection
from hyuav._support.parameters import mapping
from hyuav._support.yaml_files import read_yaml
from hyuav.experiments.run_directory import RunConfiguration, RunDirectory
from hyuav.experiments.scenarios import named_scenario
from hyuav.physics.scenario import PRESETS, Scenario

AS_TRAINED = "as_trained"
"""Name of the scenario in which every field that is None is that of the runs."""

ELSEWHERE, HORIZONS = "elsewhere", "horizons"
"""Directories within a run: evaluations over other scenarios, and over further horizons."""


def as_trained() -> dict[str, Any]:
    """The scenario of the runs, whichever they are, in plain values."""
    return {"name": AS_TRAINED} | {field.name: None for field in dataclasses.fields(Scenario)}


def runs_in(path: str | Path) -> list[RunDirectory]:
    """A run; or the runs of a sweep, in their order, or the finished ones of a comparison.

    Args:
        path: of the directory. Where there is no run in it, it is given back as if it were one,
            which is refused by whoever reads it.
    """
    directory = Path(path)
    begun, learners = (directory / "config.yaml").exists(), _learners(directory)
    if begun and not isinstance(learners, int):
        return [RunDirectory(directory)]
    inside = [
        file.parent
        for file in directory.glob("shards/*/config.yaml" if begun else "*/config.yaml")
        if file.parent.suffix != ".partial" and isinstance(_learners(file.parent), list)
    ]
    ordered = sorted(inside, key=lambda own: _with_numbers(own.name))
    return [RunDirectory(own) for own in ordered or [directory]]


def _learners(directory: Path) -> object:
    """As a ``config.yaml`` has them: a run's own, or how many each of a comparison's has."""
    try:
        return read_yaml(directory / "config.yaml").get("learners")
    except InputError:
        return None


def _with_numbers(name: str) -> list[str | int]:
    """A name's parts, of which every second is a number, so that 10 comes after 9."""
    parts = re.split(r"([0-9]+)", name)
    return [int(part) if place % 2 else part for place, part in enumerate(parts)]


def horizon_directory(run: RunDirectory, num_slots: int) -> Path:
    """Where the evaluation over another horizon than the scenario's own is kept."""
    return run.path / HORIZONS / f"T{num_slots}"


@dataclass(frozen=True)
class Destination:
    """Where trained actors are flown."""

    name: str
    """Of the scenario."""
    scenario: Scenario
    num_slots: int
    """Horizon for which the actors that fly were trained; the scenario's may be another."""
    trained: Scenario
    """In which the first training's actors were trained, over the horizon that is its default."""

    def directory(self, run: RunDirectory) -> Path:
        """Where the evaluation is kept beside a run, so that none replaces one of another scenario.

        Args:
            run: whose actors fly, or the directory that stands for several.
        """
        if self.scenario == self.trained:
            return run.path
        flown = self.scenario.num_slots
        over_horizon = dataclasses.replace(self.trained, num_slots=flown)
        if self.scenario == over_horizon and self.num_slots == flown:
            return horizon_directory(run, flown)
        label = f"{re.sub(r'[^0-9A-Za-z_-]+', '_', self.name)[:80]}_T{flown}"
        if self.num_slots != flown:
            label += f"_trained_for_T{self.num_slots}"
        if not self._is_preset:
            label += f"_{zlib.crc32(repr(self.scenario).encode()):08x}"
        return run.path / ELSEWHERE / label

    @property
    def _is_preset(self) -> bool:
        """Whether the scenario is what its name says, but for the horizon."""
        fields = {"name": self.name, "num_slots": self.scenario.num_slots}
        return self.name in PRESETS and named_scenario(fields)[1] == self.scenario


def destination(
    runs: Sequence[RunDirectory],
    values: Mapping[str, Any],
    num_slots: int | None = None,
    *,
    keeps_horizon: bool = True,
) -> Destination:
    """Where the actors of trainings are to be flown.

    Args:
        runs: of the trainings.
        values: of a scenario with its ``name``; what is None is as the runs have it.
        num_slots: horizon that the actors were trained for. By default the scenario's where it is
            given and some were, or else the first run's own, of its longest learners where none
            has its scenario's.
        keeps_horizon: whether the actors fly over the horizon that they were trained for, whatever
            the scenario's is.

    Raises:
        InputError: a run cannot be read, an unacceptable value, or values that are to be the runs'
            where theirs differ.
    """
    configurations = [run.configuration() for run in runs]
    own = configurations[0].trained_scenario
    fields = mapping("scenario", values)
    if any(value is None for value in fields.values()):
        _require_one_scenario(runs, configurations)
        given = {name: value for name, value in fields.items() if value is not None}
        fields = {**own.to_dict(), **given}
    name, scenario = named_scenario(fields)
    horizons = {horizon for of in configurations for horizon in of.horizons}
    asked = None if keeps_horizon else scenario.num_slots
    trained_for = num_slots or (asked if asked in horizons else own.num_slots)
    return Destination(
        configurations[0].scenario_name if name == AS_TRAINED else name,
        dataclasses.replace(scenario, num_slots=asked or trained_for),
        trained_for,
        own,
    )


def _require_one_scenario(
    runs: Sequence[RunDirectory], configurations: Sequence[RunConfiguration]
) -> None:
    first = configurations[0].scenario
    for run, own in zip(runs, configurations, strict=True):
        if dataclasses.replace(own.scenario, num_slots=first.num_slots) != first:
            accepted = f"the scenario of {runs[0].path}, or scenario=NAME for all of them"
            raise InputError(rejection("run", str(run.path), accepted))
