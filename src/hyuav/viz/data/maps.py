"""What each helper position of a scenario's map brings."""

import dataclasses
from typing import Literal, NamedTuple

import numpy as np
import pandas as pd
import torch
from numpy.typing import NDArray

from hyuav.experiments.schemes import NO_HELPER, SCHEMES
from hyuav.physics.outcome import Control
from hyuav.physics.scenario import Scenario
from hyuav.physics.slot import Physics, slot
from hyuav.physics.tasks import mean_tasks

Mode = Literal["relay", "jamming", "better"]
"""The helper's mode on a map; ``better`` is the one that brings more at each position."""

RULE_MODES: dict[str, Mode] = {"hybrid": "better", "relay": "relay", "jamming": "jamming"}
"""The helper's mode on the map, by who chooses it."""


class HelperMap(NamedTuple):
    """Secrecy sum-rates and offloading UEs over the map, a row per y and a column per x."""

    axis: NDArray[np.float64]
    """The coordinates along x, and along y: (N,) m."""
    rates: dict[Mode, NDArray[np.float64]]
    """The secrecy sum-rates in each mode, C_1 of relaying and C_0 of jamming: (N, N) bps/Hz."""
    offloading: dict[Mode, NDArray[np.int64]]
    """How many UEs offload in each mode: (N, N)."""
    without_helper: float
    """The secrecy sum-rate where everybody sends straight to L and nobody helps, in bps/Hz."""

    def table(self) -> pd.DataFrame:
        """Row by row from the south-west: ``x`` and ``y`` in m, and the sum-rates in bps/Hz.

        These are ``relay``, ``jamming``, the ``better`` of both, and everywhere the same without a
        helper, ``no_helper``.
        """
        x, y = np.meshgrid(self.axis, self.axis)
        alone = np.full_like(x, self.without_helper)
        columns = [("x", x), ("y", y), *self.rates.items(), (NO_HELPER, alone)]
        return pd.DataFrame({name: values.ravel() for name, values in columns})


def helper_map(scenario: Scenario, resolution: float = 1.0) -> HelperMap:
    """What each position of a helper brings in each mode; of several, what one brings alone.

    Without fading; where the UEs can fill the edge server, with tasks of mean size.

    Args:
        scenario: whose map is asked for.
        resolution: of the map in m.
    """
    scenario = dataclasses.replace(scenario, helper_starts=scenario.helper_starts[:1])
    half = scenario.map_side / 2
    axis = torch.arange(-half, half + resolution / 2, resolution, dtype=torch.float64, device="cpu")
    y, x = torch.meshgrid(axis, axis, indexing="ij")
    physics = Physics(scenario, dtype=torch.float64)
    positions = torch.stack([x, y], dim=-1).unsqueeze(-2)
    nodes, hovering = physics.nodes._replace(helper=positions), Control(torch.zeros_like(positions))
    over = slot(physics, nodes, hovering, tasks=mean_tasks(scenario, torch.float64))
    modes = over.relay, over.jamming
    relay, jamming = torch.broadcast_tensors(*(mode.sum_rate for mode in modes))
    relaying, jammed = (mode.offloading.expand(*x.shape, -1).sum(dim=-1) for mode in modes)
    chosen = torch.where(relay > jamming, relaying, jammed)
    better = torch.maximum(relay, jamming)
    silent = Physics(SCHEMES[NO_HELPER].flown_in(scenario), dtype=torch.float64)
    staying = Control(torch.zeros_like(silent.nodes.helper))
    alone = slot(silent, silent.nodes, staying, tasks=mean_tasks(scenario, torch.float64)).jamming
    return HelperMap(
        axis.numpy(),
        {"relay": relay.numpy(), "jamming": jamming.numpy(), "better": better.numpy()},
        {"relay": relaying.numpy(), "jamming": jammed.numpy(), "better": chosen.numpy()},
        float(alone.sum_rate),
    )
