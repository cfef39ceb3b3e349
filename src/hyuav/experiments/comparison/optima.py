"""The best flights of a scenario, solved once and kept in a file."""

import itertools
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import torch
import torch.nn.functional as F  # noqa: N812
from torch import Tensor

from hyuav._support.errors import InputError
from hyuav._support.files import read_parquet, write_durably
from hyuav.envs.reward import Reward
from hyuav.envs.rewards import DEFAULT
from hyuav.experiments.evaluation import helper_columns
from hyuav.experiments.schemes import OPTIMA
from hyuav.physics.scenario import Scenario
from hyuav.references.flight import FlightPolicy
from hyuav.references.optimum import solve_horizons


@dataclass(frozen=True)
class Optima:
    """The best flight of each mode rule over each horizon, in a Parquet file.

    It has a row for each slot from 0: ``scheme`` (the mode rule), ``num_slots``, ``value`` and
    ``standard_error`` of the flight, its ``upper_bound`` (NaN where there is none), ``slot``, and
    ``x`` and ``y`` in m and the ``power`` in units of the nominal power; of several helpers
    ``x_1`` and so on.
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
            whole = self._flights().dropna(subset=[*self._columns("x"), *self._columns("y")])
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
                    "upper_bound": np.nan if (own := optimum.upper_bound) is None else own,
                    "slot": range(num_slots + 1),
                    **self._of_helpers("x", optimum.path[..., 0]),
                    **self._of_helpers("y", optimum.path[..., 1]),
                    **self._of_helpers("power", F.pad(optimum.share, (0, 0, 1, 0), value=1.0)),
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
        flight = self._flight(rule, num_slots)
        path = [flight[self._columns(axis)].to_numpy() for axis in "xy"]
        share = flight[self._columns("power")].to_numpy()[1:]
        return FlightPolicy(np.stack(path, axis=-1), self.scenario, torch.tensor(share))

    def upper_bound(self, rule: str, num_slots: int) -> float | None:
        """What no flight under a mode rule over a horizon earns; None where that is not known.

        Raises:
            InputError: the file is missing or damaged.
        """
        bound = self._flight(rule, num_slots)["upper_bound"].iloc[0]
        return None if np.isnan(bound) else float(bound)

    def _flight(self, rule: str, num_slots: int) -> pd.DataFrame:
        flights = self._flights()
        flight = flights[(flights["scheme"] == rule) & (flights["num_slots"] == num_slots)]
        return flight.sort_values("slot")

    def _columns(self, name: str) -> list[str]:
        return helper_columns(name, self.scenario.num_helpers)

    def _of_helpers(self, name: str, values: Tensor) -> dict[str, Tensor]:
        """A column of values (..., H) for each helper."""
        return dict(zip(self._columns(name), values.unbind(dim=-1), strict=True))

    def _flights(self) -> pd.DataFrame:
        columns = ["scheme", "num_slots", "value", "standard_error", "upper_bound", "slot"]
        columns += [own for name in ("x", "y", "power") for own in self._columns(name)]
        return read_parquet(self.file, "best flights", columns)
