"""The secrecy sum-rate at every helper position of a scenario's map."""

from typing import Literal, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray

from hyuav.physics.scenario import Scenario
from hyuav.physics.slot import Control, Physics, slot
from hyuav.physics.tasks import mean_tasks

Mode = Literal["relay", "jamming", "better"]
"""The helper's mode on a map; ``better`` is the one that brings more at each position."""


class SumRateMap(NamedTuple):
    """Secrecy sum-rates over the map, a row per y and a column per x."""

    axis: NDArray[np.float64]
    """The coordinates along x, and along y: (N,) m."""
    relay: NDArray[np.float64]
    """C_1: (N, N) bps/Hz."""
    jamming: NDArray[np.float64]
    """C_0: (N, N) bps/Hz."""

    @property
    def better(self) -> NDArray[np.float64]:
        """What the better mode brings: (N, N) bps/Hz."""
        return np.maximum(self.relay, self.jamming)

    def of(self, mode: Mode) -> NDArray[np.float64]:
        """The rates in a mode: (N, N) bps/Hz."""
        return {"relay": self.relay, "jamming": self.jamming, "better": self.better}[mode]


def sum_rates_over_map(scenario: Scenario, resolution: float = 1.0) -> SumRateMap:
    """The secrecy sum-rate at every helper position, in each mode.

    Without fading; where the UEs can fill the edge server, with tasks of mean size.

    Args:
        scenario: whose map is asked for.
        resolution: of the map in m.
    """
    half = scenario.map_side / 2
    axis = torch.arange(-half, half + resolution / 2, resolution, dtype=torch.float64)
    physics = Physics(scenario, dtype=torch.float64)
    positions = torch.cartesian_prod(axis, axis).reshape(len(axis), len(axis), 1, 2)
    nodes, hovering = physics.nodes._replace(helper=positions), Control(torch.zeros_like(positions))
    over = slot(physics, nodes, hovering, tasks=mean_tasks(scenario, torch.float64))
    relay, jamming = (mode.sum_rate.T.numpy() for mode in (over.relay, over.jamming))
    return SumRateMap(axis.numpy(), relay, jamming)
