"""The network takes nodes as a set, and decisions turn with the world."""

import dataclasses

import pytest
import torch

from hyuav import Scenario, family
from hyuav.learning.generalist.decide import Helpers, World, choices
from hyuav.learning.generalist.network import GeneralistNetwork
from hyuav.learning.generalist.scene import CANDIDATES, REACH, TURNS, Scenes, scenes_of
from hyuav.learning.generalist.tokens import Tokens

Points = tuple[tuple[float, float], ...]


def world_of(scenarios: list[Scenario]) -> World:
    scenes = Scenes.joined(scenes_of(scenario, "hybrid", draws=1) for scenario in scenarios)
    return World(scenes, Tokens.of(scenarios))


@pytest.fixture(scope="module")
def network() -> GeneralistNetwork:
    torch.manual_seed(0)
    return GeneralistNetwork(width=32, token_width=16).eval()


@pytest.fixture(scope="module")
def several() -> list[Scenario]:
    drawn = [family("one", seed).scenario for seed in range(3)]
    assert len({scenario.num_ues for scenario in drawn}) == 3
    return drawn


def test_the_order_of_the_users_does_not_matter(
    network: GeneralistNetwork, several: list[Scenario]
) -> None:
    turned = dataclasses.replace(several[0], ue_positions=several[0].ue_positions[::-1])
    helpers = Helpers(torch.tensor([0]), torch.tensor([[40, 50]]), torch.tensor([7]))
    one, other = (choices(network, world_of([own]), helpers) for own in (several[0], turned))
    torch.testing.assert_close(one.worth, other.worth)


def test_rows_of_different_sizes_are_as_each_alone(
    network: GeneralistNetwork, several: list[Scenario]
) -> None:
    place, left = torch.tensor([[40, 50]]), torch.tensor([7])
    together = choices(
        network,
        world_of(several),
        Helpers(torch.arange(3), place.expand(3, 2), left.expand(3)),
    )
    for number, scenario in enumerate(several):
        alone = choices(network, world_of([scenario]), Helpers(torch.tensor([0]), place, left))
        torch.testing.assert_close(together.worth[number], alone.worth[0])


@pytest.mark.parametrize("turn", TURNS[1:])
def test_a_turned_world_looks_as_the_world_does_from_the_turned_side(
    network: GeneralistNetwork, turn: torch.Tensor
) -> None:
    base = dataclasses.replace(
        family("one", 4).scenario, helper_starts=((0.0, 0.0),), power_control=False
    )

    def rotated(points: Points) -> Points:
        return tuple((x, y) for x, y in (torch.tensor(points) @ turn.T.float()).tolist())

    turned = dataclasses.replace(
        base,
        ue_positions=rotated(base.ue_positions),
        legitimate_position=rotated((base.legitimate_position,))[0],
        eavesdropper_positions=rotated(base.eavesdropper_positions),
    )
    helpers = Helpers(torch.tensor([0]), torch.tensor([[50, 50]]), torch.tensor([7]))
    one = choices(network, world_of([base]), helpers)
    other = choices(network, world_of([turned]), helpers, turn)
    row, column = (CANDIDATES @ turn.T).unbind(dim=-1)
    # float32 may put a UE on either side of an edge of coverage at single places
    close = (one.worth - other.worth[:, row * REACH + column + len(row) // 2]).abs() < 1e-3
    assert close.float().mean() > 0.98


def test_a_choice_reads_the_map_at_the_candidates(
    network: GeneralistNetwork, several: list[Scenario]
) -> None:
    world = world_of(several[:1])
    helpers = Helpers(torch.tensor([0]), torch.tensor([[40, 50]]), torch.tensor([7]))
    choice = choices(network, world, helpers)
    place = torch.tensor([40, 50]) + CANDIDATES
    assert torch.equal(choice.cell[0], place[:, 0] * world.scenes.side + place[:, 1])
    assert torch.equal(choice.rewards[0], world.scenes.rewards[0, choice.cell[0]])
