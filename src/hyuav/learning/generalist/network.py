"""The generalist's network: what can still be earned from each place within reach."""

import torch
import torch.nn.functional as F  # noqa: N812
from torch import Tensor, nn

from hyuav.learning.generalist.scene import REACH, VIEW_SIZE
from hyuav.learning.generalist.tokens import TOKEN_SIZE

LONGEST = 32
"""Slots that are told apart; more are flown as so many."""

COARSE = REACH // 2 + 1
"""Places along each axis for which values to go are told; between them they are interpolated."""


class GeneralistNetwork(nn.Module):
    """Values to go of the places within a helper's reach, from all that is known of its world.

    The nodes enter as a set: each token passes the same small network, and what comes out is
    added up, so that their order does not matter and there may be any number of them.

    Args:
        width: of the hidden layers.
        token_width: of the hidden layers that tokens pass.
    """

    interpolation: Tensor
    """(COARSE^2, REACH^2), see :func:`_interpolation`."""

    def __init__(self, width: int = 512, token_width: int = 64) -> None:
        super().__init__()
        self.each = nn.Sequential(
            nn.Linear(TOKEN_SIZE, token_width),
            nn.SiLU(),
            nn.Linear(token_width, token_width),
            nn.SiLU(),
        )
        self.all = nn.Sequential(
            nn.Linear(VIEW_SIZE + token_width + LONGEST + 1 + 2, width),
            nn.SiLU(),
            nn.Linear(width, width),
            nn.SiLU(),
            nn.Linear(width, width // 2),
            nn.SiLU(),
            nn.Linear(width // 2, COARSE**2),
        )
        self.register_buffer("interpolation", _interpolation(), persistent=False)

    def forward(self, views: Tensor, tokens: Tensor, owner: Tensor, slots_left: Tensor) -> Tensor:
        """Estimate what the slots after the next one bring, by the place in that one.

        Args:
            views: (B, VIEW_SIZE), what the maps tell around each helper.
            tokens: (M, TOKEN_SIZE), the nodes around all of them.
            owner: (M,) int64, to whom each token belongs.
            slots_left: (B,) int64, how many slots follow the next one.

        Returns:
            (B, REACH^2), in units of what the best place brings in a slot.
        """
        each = self.each(tokens)
        nodes = each.new_zeros(views.shape[0], each.shape[-1]).index_add(0, owner, each) / 10.0
        left = slots_left.clamp(max=LONGEST)
        clock = F.one_hot(left, LONGEST + 1).to(nodes.dtype)
        count = left.to(nodes.dtype).unsqueeze(-1)
        known = [views, nodes, clock, count / LONGEST, 1.0 / (1.0 + count)]
        values: Tensor = self.all(torch.cat(known, dim=-1))
        return values @ self.interpolation


def _interpolation() -> Tensor:
    """By what to multiply values of coarse places for those of all: (COARSE^2, REACH^2)."""
    each = torch.eye(COARSE**2, device="cpu").reshape(-1, 1, COARSE, COARSE)
    fine = F.interpolate(each, size=(REACH, REACH), mode="bilinear", align_corners=True)
    return fine.flatten(1)
