"""How the generalist decides: by what a slot brings and what can be earned after it."""

from typing import NamedTuple

import torch
from torch import Tensor, nn

from hyuav.learning.generalist.network import GeneralistNetwork
from hyuav.learning.generalist.scene import (
    CANDIDATES,
    OUTSIDE,
    REACH,
    TURNS,
    VIEWS,
    Scenes,
    window,
)
from hyuav.learning.generalist.tokens import Tokens


class World(NamedTuple):
    """Scenes with their nodes."""

    scenes: Scenes
    """(S,)."""
    tokens: Tokens
    """Of the same scenes."""


class Helpers(NamedTuple):
    """Helpers between two slots, each in a scene."""

    scene: Tensor
    """(B,) int64."""
    place: Tensor
    """(B, 2) int64: row and column of the scene's lattice."""
    slots_left: Tensor
    """(B,) int64, the next one among them."""


class Choice(NamedTuple):
    """What helpers may do next."""

    worth: Tensor
    """(B, REACH^2): what all slots left would bring, in units of what the best place brings in one;
    -infinity out of reach."""
    rewards: Tensor
    """(B, REACH^2): what the next slot alone would."""
    cell: Tensor
    """(B, REACH^2) int64: the candidates in the scene's maps."""


def choices(network: nn.Module, world: World, helpers: Helpers, turn: Tensor = TURNS[0]) -> Choice:
    """Estimate what each place within reach is worth.

    Args:
        network: of the generalist.
        world: in which the helpers fly.
        helpers: that are to decide.
        turn: (2, 2), the symmetry in which the network sees the world, or (B, 2, 2), of each
            helper.

    Returns:
        of all candidates, in the order of the world as it is.
    """
    scenes, scene, place = world.scenes, helpers.scene, helpers.place
    turns, straight = (own.to(place.device).reshape(-1, 2, 2) for own in (turn, TURNS[0]))
    cell = window(scenes.side, place, 1, REACH, straight)
    rewards = scenes.rewards_at(scene, cell)
    views = [scenes.seen(view, scene, place, turns) for view in range(len(VIEWS))]
    position = scenes.corner[scene] + scenes.spacing[scene] * place
    tokens, owner = world.tokens.around(scene, position, turns)
    values = network(torch.cat(views, dim=-1), tokens, owner, helpers.slots_left - 1)
    # Where the network has the candidates: the way of the inverse turn.
    middle = place.new_full((len(turns), 2), REACH // 2)
    back = window(REACH, middle, 1, REACH, turns.mT)
    values = values.gather(1, back.expand_as(values))
    allowed = scenes.reachable[scene] & (rewards > OUTSIDE)
    return Choice((rewards + values).where(allowed, -torch.inf), rewards, cell)


def moved(helpers: Helpers, chosen: Tensor) -> Helpers:
    """Helpers after the slot, each at one of the candidates (B,) of the unturned world."""
    step = CANDIDATES.to(chosen.device)[chosen]
    return Helpers(helpers.scene, helpers.place + step, helpers.slots_left - 1)


@torch.no_grad()
def flights(
    network: GeneralistNetwork, world: World, scene: Tensor
) -> tuple[Tensor, list[Helpers]]:
    """Fly scenes of a world from their starts, without fading.

    Args:
        network: of the generalist.
        world: in which it flies.
        scene: (B,) int64, those that are flown.

    Returns:
        what each flight brings, (B,) in units of what the best place brings in a slot, and where
        the helpers were before each slot, as long as they fly.
    """
    scenes = world.scenes
    flight = torch.arange(len(scene), device=scene.device)
    helpers = Helpers(scene, scenes.start[scene], scenes.num_slots[scene].squeeze(-1))
    earned, flown = torch.zeros(len(scene), device=scene.device), []
    while len(flight):
        flown.append(helpers)
        choice = choices(network, world, helpers)
        chosen = choice.worth.argmax(dim=-1)
        earned[flight] += choice.rewards.gather(1, chosen.unsqueeze(-1)).squeeze(-1)
        after = moved(helpers, chosen)
        going = after.slots_left > 0
        helpers, flight = Helpers(*(part[going] for part in after)), flight[going]
    return earned, flown
