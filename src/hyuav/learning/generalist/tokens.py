"""The nodes of scenarios as sets of tokens, any number of them, without padding."""

import math
from collections.abc import Sequence
from typing import NamedTuple, Self

import torch
from torch import Tensor

from hyuav.physics.layout import Nodes
from hyuav.physics.scenario import Scenario

KINDS = 4
"""UEs, L, eavesdroppers and helpers."""

TOKEN_SIZE = 2 + KINDS + 6
"""Numbers of a token: a place, a kind, and what is known of the node."""

LENGTH = 100.0
"""In m, of which places and radii are told."""

DECIBELS = 50.0
"""Of which powers are told."""


class Tokens(NamedTuple):
    """The nodes of scenes, one after another."""

    places: Tensor
    """(N, 2) m."""
    known: Tensor
    """(N, TOKEN_SIZE - 2)."""
    first: Tensor
    """(S,) int64: where each scene's begin."""
    counts: Tensor
    """(S,) int64."""

    @classmethod
    def of(cls, scenarios: Sequence[Scenario]) -> Self:
        """The tokens of scenarios, a scene for each."""
        several = [_of_one(scenario) for scenario in scenarios]
        count = torch.tensor([len(places) for places, _ in several], device="cpu")
        places, known = (torch.cat(parts) for parts in zip(*several, strict=True))
        return cls(places, known, count.cumsum(dim=0) - count, count)

    def around(self, scene: Tensor, position: Tensor, turns: Tensor) -> tuple[Tensor, Tensor]:
        """The tokens as helpers see them, with places relative to their own.

        Args:
            scene: (B,) int64, of each helper.
            position: (B, 2) m, of each helper.
            turns: (B, 2, 2), the symmetry in which each sees the map, or (1, 2, 2), in which all
                do.

        Returns:
            (M, TOKEN_SIZE), and to which helper each belongs, (M,) int64.
        """
        count = self.counts[scene]
        owner = torch.repeat_interleave(count)
        # A helper's tokens follow one another, from the first of its scene on.
        begin = self.first[scene] - (count.cumsum(dim=0) - count)
        index = begin[owner] + torch.arange(len(owner), device=scene.device)
        relative = (self.places[index] - position[owner]) / LENGTH
        turns = turns.to(relative.dtype)
        if len(turns) == 1:
            seen = relative @ turns[0]
        else:
            seen = (relative.unsqueeze(-2) @ turns[owner]).squeeze(-2)
        return torch.cat([seen, self.known[index]], dim=-1), owner


def _of_one(scenario: Scenario) -> tuple[Tensor, Tensor]:
    nodes = Nodes.of(scenario)
    groups = nodes.ue, nodes.legitimate.unsqueeze(0), nodes.eavesdropper, nodes.helper
    kinds = torch.arange(KINDS, device="cpu").repeat_interleave(
        torch.tensor([len(group) for group in groups], device="cpu")
    )
    known = torch.tensor(
        [
            scenario.coverage_radius / LENGTH,
            scenario.eavesdropper_altitude / LENGTH,
            float(scenario.eavesdroppers == "colluding"),
            float(scenario.power_control),
            *(_decibels(power) for power in (scenario.jamming_power, scenario.relay_power)),
        ],
        dtype=torch.float32,
        device="cpu",
    )
    one_hot = torch.nn.functional.one_hot(kinds, KINDS).float()
    return torch.cat(groups), torch.cat([one_hot, known.expand(len(kinds), -1)], dim=-1)


def _decibels(power: float) -> float:
    """Relative to 1 mW, at least -100 dB."""
    return 10.0 * math.log10(max(power * 1e3, 1e-10)) / DECIBELS
