"""The best flights of a scenario, solved once and kept in a file."""

import itertools
from dataclasses import dataclass
from pathlib import Path

import pandas as pd
import torch

from hyuav._support.errors import InputError
from hyuav._support.files import read_parquet, write_durably
from hyuav.envs.reward import Reward
from hyuav.envs.rewards import DEFAULT
from hyuav.experiments.schemes import OPTIMA
from hyuav.physics.scenario import Scenario
from hyuav.references.flight import FlightPolicy
from hyuav.references.optimum import solve_horizons


@dataclass(frozen=True)
class Optima:
    """The best flight of each mode rule over each horizon, in a Parquet file.

    It has a row for each slot from 0: ``scheme`` (the mode rule), ``num_slots``, ``value`` and
    ``standard_error`` of the flight, ``slot``, and ``x`` and ``y`` in m.
    """

    scenario: Scenario
    """Whose ``num_slots`` is not used."""
    horizons: tuple[int, ...]
    resolution: float | None
    """Of the grid in m; None for the default."""
    file: Path
    reward: Reward = DEFAULT
    """Of which they are the best."""

    @property
    def is_solved(self) -> bool:
        """Whether the file holds every flight whole."""
        try:
            whole = self._flights().dropna(subset=["x", "y"])
        except InputError:
            return False
        lengths = whole.groupby(["scheme", "num_slots"]).size()
        every = itertools.product(OPTIMA, self.horizons)
        return all(lengths.get((rule, num_slots)) == num_slots + 1 for rule, num_slots in every)

    def solve(self) -> None:
        """Find the flights and write the file."""
        found = solve_horizons(
            self.scenario, self.horizons, resolution=self.resolution, reward=self.reward
        )
        flights = [
            pd.DataFrame(
                {
                    "scheme": rule,
                    "num_slots": num_slots,
                    "value": optimum.value,
                    "standard_error": optimum.standard_error,
                    "slot": range(num_slots + 1),
                    "x": optimum.path[:, 0, 0],
                    "y": optimum.path[:, 0, 1],
                    "power": [1.0, *optimum.share[:, 0].tolist()],
                }
            )
            for rule, optima in found.items()
            for num_slots, optimum in optima.items()
        ]
        write_durably(self.file, pd.concat(flights, ignore_index=True).to_parquet())

    def policy(self, rule: str, num_slots: int) -> FlightPolicy:
        """The way to fly the best flight of a mode rule over a horizon.

        Raises:
            InputError: the file is missing or damaged.
        """
        flights = self._flights()
        flight = flights[(flights["scheme"] == rule) & (flights["num_slots"] == num_slots)]
        flight = flight.sort_values("slot")
        path = torch.tensor(flight[["x", "y"]].to_numpy()).unsqueeze(1)
        return FlightPolicy(path, self.scenario, torch.tensor(flight[["power"]].to_numpy()[1:]))

    def _flights(self) -> pd.DataFrame:
        columns = ["scheme", "num_slots", "value", "standard_error", "slot", "x", "y", "power"]
        return read_parquet(self.file, "best flights", columns)
