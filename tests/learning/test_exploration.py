import pytest
import torch
from tensordict import TensorDict, TensorDictBase

from hyuav import Scenario
from hyuav.learning.exploration import GaussianNoise, WarmUp


def slot(learners: int, step_count: int = 0) -> TensorDictBase:
    return TensorDict(
        action=torch.zeros(learners, 2),
        step_count=torch.full((learners, 1), step_count),
        batch_size=[learners],
    )


def test_noise_begins_with_the_given_variance() -> None:
    torch.manual_seed(0)
    noise = GaussianNoise(20_000, variance=0.01, decay=1.0, decay_per="slot")
    assert noise(slot(20_000))["action"].var().item() == pytest.approx(0.01, rel=0.03)


def test_noise_decays_after_every_slot() -> None:
    noise = GaussianNoise(1, variance=0.6, decay=0.999, decay_per="slot")
    for count in range(10):
        noise(slot(1, count))
    assert noise.std.item() == pytest.approx(0.6**0.5 * 0.999**9)


def test_noise_decays_after_every_episode_where_told_so() -> None:
    noise = GaussianNoise(1, variance=0.6, decay=0.9, decay_per="episode")
    for _ in range(3):
        for count in range(5):
            noise(slot(1, count))
    assert noise.std.item() == pytest.approx(0.6**0.5 * 0.9**2)


def test_noisy_actions_are_clipped() -> None:
    noise = GaussianNoise(1000, variance=25.0, decay=1.0, decay_per="slot")
    action = noise(slot(1000))["action"]
    assert action.abs().max() == 1.0


def test_learners_are_disturbed_independently() -> None:
    torch.manual_seed(0)
    noise = GaussianNoise(2, variance=0.01, decay=1.0, decay_per="slot")
    draws = torch.stack([noise(slot(2))["action"] for _ in range(4000)])
    correlation = torch.corrcoef(draws.reshape(4000, 4).T)
    assert (correlation - torch.eye(4)).abs().max() < 0.06


SCENARIO = Scenario.preset("two_clusters")


def fly(warm_up: WarmUp, learners: int, num_slots: int) -> torch.Tensor:
    """Where an episode of learners whose actors want to stay leads: (slots, N, 2) m."""
    position, flight = torch.tensor(SCENARIO.helper_starts[0]).expand(learners, 2), []
    for count in range(num_slots):
        seen = slot(learners, count).set("position", position.unsqueeze(-2))
        position = (position + 20.0 * warm_up(seen)["action"]).clamp(-100.0, 100.0)
        flight.append(position)
    return torch.stack(flight)


def test_a_warm_up_ends_after_its_episodes() -> None:
    torch.manual_seed(0)
    warm_up = WarmUp(3, 2, SCENARIO)
    start = torch.tensor(SCENARIO.helper_starts[0])
    assert bool((fly(warm_up, 3, 5) != start).all())
    assert bool((fly(warm_up, 3, 5) != start).all())
    assert bool((fly(warm_up, 3, 5) == start).all())


def test_a_warm_up_flies_somewhere_and_stays_there() -> None:
    torch.manual_seed(0)
    warm_up = WarmUp(50, 40, SCENARIO)
    for _ in range(40):
        flight = fly(warm_up, 50, 20)
        steps = flight.diff(dim=0).abs().amax(dim=-1)
        assert steps.max() <= 20.0 + 1e-4
        assert steps[10:].max() < 20.0  # at most eight slots of way, and then only noise
        assert steps[10:].mean() < 5.0
        assert bool((steps[10:] > 0.0).any())


def test_every_warm_up_covers_the_map_and_its_corners() -> None:
    torch.manual_seed(0)
    warm_up = WarmUp(50, 100, SCENARIO)
    reached = torch.stack([fly(warm_up, 50, 20)[-1] for _ in range(100)])
    spots = torch.cartesian_prod(torch.arange(-100.0, 101.0, 20.0), torch.arange(-100.0, 101.0, 20))
    nearest = torch.cdist(spots.expand(50, -1, 2), reached.transpose(0, 1)).amin(dim=-1)
    assert nearest.max() < 30.0
    corners = (spots.abs() == 100.0).all(dim=-1)
    assert nearest[:, corners].median() < 10.0


def test_warm_ups_go_in_orders_of_their_own() -> None:
    torch.manual_seed(0)
    first = fly(WarmUp(4000, 60, SCENARIO), 4000, 12)[-1]
    quadrants = [
        (first.sign() == torch.tensor(signs)).all(dim=-1).float().mean().item()
        for signs in ((1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0))
    ]
    assert quadrants == pytest.approx([0.25] * 4, abs=0.03)
