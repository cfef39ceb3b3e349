"""Flights to places all over the map."""

import dataclasses

import pytest
import torch
from tensordict import TensorDict

from hyuav import Guide, Scenario
from hyuav.learning.guide.warm_up import WarmUp, evenly

SCENARIO = Scenario.preset("two_clusters")


def fly(warm_up: WarmUp, learners: int, num_slots: int) -> torch.Tensor:
    """Where an episode of learners whose actors want to stay leads: (slots, N, 2) m."""
    position, flight = torch.tensor(SCENARIO.helper_starts[0]).expand(learners, 2), []
    for count in range(num_slots):
        seen = TensorDict(
            action=torch.zeros(learners, 2),
            step_count=torch.full((learners, 1), count),
            position=position.unsqueeze(-2),
            batch_size=[learners],
        )
        position = (position + 20.0 * warm_up(seen)["action"]).clamp(-100.0, 100.0)
        flight.append(position)
    return torch.stack(flight)


def test_a_warm_up_ends_after_its_episodes() -> None:
    torch.manual_seed(0)
    warm_up = WarmUp(3, Guide(warm_up_episodes=2), SCENARIO)
    start = torch.tensor(SCENARIO.helper_starts[0])
    assert bool((fly(warm_up, 3, 5) != start).all())
    assert bool((fly(warm_up, 3, 5) != start).all())
    assert bool((fly(warm_up, 3, 5) == start).all())


def test_a_warm_up_flies_somewhere_and_stays_there() -> None:
    torch.manual_seed(0)
    warm_up = WarmUp(50, Guide(warm_up_episodes=40), SCENARIO)
    for _ in range(40):
        flight = fly(warm_up, 50, 20)
        steps = flight.diff(dim=0).abs().amax(dim=-1)
        assert steps.max() <= 20.0 + 1e-4
        assert steps[10:].max() < 20.0  # at most eight slots of way, and then only noise
        assert steps[10:].mean() < 5.0
        assert bool((steps[10:] > 0.0).any())


def test_every_warm_up_covers_the_map_and_its_corners() -> None:
    torch.manual_seed(0)
    warm_up = WarmUp(50, Guide(warm_up_episodes=100), SCENARIO)
    reached = torch.stack([fly(warm_up, 50, 20)[-1] for _ in range(100)])
    spots = torch.cartesian_prod(torch.arange(-100.0, 101.0, 20.0), torch.arange(-100.0, 101.0, 20))
    nearest = torch.cdist(spots.expand(50, -1, 2), reached.transpose(0, 1)).amin(dim=-1)
    assert nearest.max() < 30.0
    corners = (spots.abs() == 100.0).all(dim=-1)
    assert nearest[:, corners].median() < 10.0


def test_each_helper_has_destinations_of_its_own_and_powers_are_drawn_evenly() -> None:
    torch.manual_seed(0)
    starts = ((-60.0, -60.0), (60.0, -60.0))
    scenario = dataclasses.replace(SCENARIO, helper_starts=starts, power_control=True)
    warm_up, ends, powers = WarmUp(3, Guide(), scenario), [], []
    for _ in range(60):
        position = torch.tensor(starts).expand(3, 2, 2)
        for count in range(12):
            seen = TensorDict(
                action=torch.zeros(3, 6),
                step_count=torch.full((3, 1), count),
                position=position,
                batch_size=[3],
            )
            velocity, power = warm_up(seen)["action"].unflatten(-1, (2, 3)).tensor_split([2], -1)
            position = (position + 20.0 * velocity).clamp(-100.0, 100.0)
            powers.append(power)
        ends.append(position)
    coordinates = torch.stack(ends).flatten(0, 1).flatten(1)
    assert (torch.corrcoef(coordinates.T) - torch.eye(4)).abs().max() < 0.3
    drawn = torch.stack(powers).flatten()
    assert torch.histc(drawn, 10, -1.0, 1.0).std() < 0.1 * len(drawn) / 10
    assert abs(drawn.diff().sign().mean()) < 0.1  # anew in each slot


@pytest.mark.parametrize("dimensions", [1, 2, 4])
def test_multiples_fill_the_unit_cube_evenly(dimensions: int) -> None:
    numbers = torch.tensor(evenly(dimensions), dtype=torch.float64)
    points = torch.frac(torch.arange(4096).unsqueeze(-1) * numbers)
    cells = (points * 4).long() @ (4 ** torch.arange(dimensions))
    counts = torch.bincount(cells, minlength=4**dimensions)
    assert counts.min() > 0.5 * counts.float().mean()
    assert counts.max() < 1.5 * counts.float().mean()


def test_warm_ups_go_in_orders_of_their_own() -> None:
    torch.manual_seed(0)
    first = fly(WarmUp(4000, Guide(warm_up_episodes=60), SCENARIO), 4000, 12)[-1]
    quadrants = [
        (first.sign() == torch.tensor(signs)).all(dim=-1).float().mean().item()
        for signs in ((1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0))
    ]
    assert quadrants == pytest.approx([0.25] * 4, abs=0.03)
