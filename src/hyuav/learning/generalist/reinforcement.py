"""Reinforcement learning across scenarios: values to go that agree with those a slot later.

What a slot brings is known, and so is where a helper is after it. What is left to learn is the
critic of soft actor-critic for discrete actions (Christodoulou, arXiv:1910.07207), with the policy
that is exact for it, the softmax of what places are worth, and without the bonus of entropy. No
scenario has to be solved for it.
"""

import torch
import torch.nn.functional as F  # noqa: N812
from torch import Tensor, nn

from hyuav.learning.generalist.decide import Choice, Helpers, World, choices, moved

TEMPERATURE = 0.02
"""Of the softmax over places, in units of what the best place brings in a slot."""


def explored(choice: Choice, generator: torch.Generator) -> Tensor:
    """Two of the places within reach, one by the softmax and one anywhere: (B, 2) candidates."""
    worth = choice.worth.detach().cpu()
    anywhere = torch.zeros_like(worth).where(worth > -torch.inf, -torch.inf)
    # The largest of values with Gumbel noise is drawn by their softmax.
    noise = torch.rand(2, *worth.shape, generator=generator).log().neg().log().neg()
    noisy = torch.stack([worth / TEMPERATURE, anywhere]) + noise
    return noisy.argmax(dim=-1).mT.to(choice.worth.device)


def bellman_error(
    network: nn.Module,
    delayed: nn.Module,
    world: World,
    helpers: Helpers,
    turn: Tensor,
    generator: torch.Generator,
) -> Tensor:
    """How far values to go are from what the next slot brings and the values after it (Huber).

    Args:
        network: of the generalist.
        delayed: the same of some steps ago, by which the values after it are told.
        world: in which the helpers fly.
        helpers: that are to decide.
        turn: as for :func:`hyuav.learning.generalist.decide.choices`.
        generator: of the places that are looked at.
    """
    choice = choices(network, world, helpers, turn)
    chosen = explored(choice, generator)
    told = (choice.worth - choice.rewards).gather(1, chosen)
    with torch.no_grad():
        after = [moved(helpers, each) for each in chosen.unbind(dim=1)]
        both = Helpers(*(torch.cat(parts) for parts in zip(*after, strict=True)))
        going = both.slots_left > 0
        later = choices(delayed, world, Helpers(*(part[going] for part in both)))
        policy = (later.worth / TEMPERATURE).softmax(dim=-1)
        value = (policy * later.worth.clamp(min=0.0)).sum(dim=-1)
        wanted = value.new_zeros(len(going)).masked_scatter(going, value)
    wanted = wanted.reshape(2, -1).mT
    return F.smooth_l1_loss(told, wanted, beta=0.1)
