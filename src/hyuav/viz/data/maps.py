"""What each helper position of a scenario's map brings."""

from typing import Literal, NamedTuple

import numpy as np
import pandas as pd
import torch
from numpy.typing import NDArray

from hyuav.physics.offloading import prefers_relay
from hyuav.physics.scenario import Scenario
from hyuav.physics.slot import Control, Physics, slot
from hyuav.physics.tasks import mean_tasks

Mode = Literal["relay", "jamming", "better"]
"""The helper's mode on a map; ``better`` is the one that brings more at each position."""

RULE_MODES: dict[str, Mode] = {"hybrid": "better", "relay": "relay", "jamming": "jamming"}
"""The helper's mode on the map, by who chooses it."""


class HelperMap(NamedTuple):
    """Secrecy sum-rates and offloading UEs over the map, a row per y and a column per x."""

    axis: NDArray[np.float64]
    """The coordinates along x, and along y: (N,) m."""
    relay: NDArray[np.float64]
    """C_1: (N, N) bps/Hz."""
    jamming: NDArray[np.float64]
    """C_0: (N, N) bps/Hz."""
    relay_offloading: NDArray[np.int64]
    """How many UEs offload while the helper relays: (N, N)."""
    jamming_offloading: NDArray[np.int64]
    """How many UEs offload while the helper jams: (N, N)."""
    prefers_relay: NDArray[np.bool_]
    """Where relaying is the better mode: (N, N)."""

    @property
    def better(self) -> NDArray[np.float64]:
        """What the better mode brings: (N, N) bps/Hz."""
        return np.maximum(self.relay, self.jamming)

    def rates(self, mode: Mode) -> NDArray[np.float64]:
        """The secrecy sum-rates in a mode: (N, N) bps/Hz."""
        return {"relay": self.relay, "jamming": self.jamming, "better": self.better}[mode]

    def offloading(self, mode: Mode) -> NDArray[np.int64]:
        """How many UEs offload in a mode: (N, N)."""
        relay, jamming = self.relay_offloading, self.jamming_offloading
        better = np.where(self.prefers_relay, relay, jamming)
        return {"relay": relay, "jamming": jamming, "better": better}[mode]

    def table(self) -> pd.DataFrame:
        """Row by row from the south-west: ``x`` and ``y`` in m, and the sum-rates in bps/Hz.

        These are ``relay``, ``jamming``, and the ``better`` of both.
        """
        x, y = np.meshgrid(self.axis, self.axis)
        columns = {"x": x, "y": y, "relay": self.relay, "jamming": self.jamming}
        columns |= {"better": self.better}
        return pd.DataFrame({name: values.ravel() for name, values in columns.items()})


def helper_map(scenario: Scenario, resolution: float = 1.0) -> HelperMap:
    """What each helper position brings in each mode.

    Without fading; where the UEs can fill the edge server, with tasks of mean size.

    Args:
        scenario: whose map is asked for.
        resolution: of the map in m.
    """
    half = scenario.map_side / 2
    axis = torch.arange(-half, half + resolution / 2, resolution, dtype=torch.float64)
    y, x = torch.meshgrid(axis, axis, indexing="ij")
    physics = Physics(scenario, dtype=torch.float64)
    positions = torch.stack([x, y], dim=-1).unsqueeze(-2)
    nodes, hovering = physics.nodes._replace(helper=positions), Control(torch.zeros_like(positions))
    over = slot(physics, nodes, hovering, tasks=mean_tasks(scenario, torch.float64))
    modes = over.relay, over.jamming
    rates = torch.broadcast_tensors(*(mode.sum_rate for mode in modes))
    counts = (mode.offloading.expand(*x.shape, -1).sum(dim=-1) for mode in modes)
    return HelperMap(
        axis.numpy(),
        *(values.numpy() for values in (*rates, *counts, prefers_relay(*rates))),
    )
