import pytest
import torch
from tensordict import TensorDict, TensorDictBase

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


def test_noise_stays_above_its_floor() -> None:
    torch.manual_seed(0)
    noise = GaussianNoise(20_000, variance=0.6, decay=0.1, decay_per="slot", floor=0.05)
    for _ in range(9):
        action = noise(slot(20_000))["action"]
    assert action.std().item() == pytest.approx(0.05, rel=0.03)


def fly(warm_up: WarmUp, learners: int, num_slots: int) -> torch.Tensor:
    """The actions (slots, N, 2) of one episode in which the actor wants to stay."""
    return torch.stack([warm_up(slot(learners, count))["action"] for count in range(num_slots)])


def test_a_warm_up_ends_after_its_episodes() -> None:
    warm_up = WarmUp(3, episodes=2)
    assert bool((fly(warm_up, 3, 5) != 0.0).all())
    assert bool((fly(warm_up, 3, 5) != 0.0).all())
    assert bool((fly(warm_up, 3, 5) == 0.0).all())


def test_a_warm_up_hovers_and_sweeps() -> None:
    torch.manual_seed(0)
    warm_up = WarmUp(100, episodes=60)
    flights = torch.stack([fly(warm_up, 100, 20) for _ in range(60)])
    assert flights.abs().max() == 1.0
    distance = flights.sum(dim=1).norm(dim=-1)  # of each flight, in slots at full speed
    assert distance.amin(dim=0).max() < 2.0
    assert distance.amax(dim=0).min() > 8.0
    roots = (flights[:, 0].norm(dim=-1) / 2.0**0.5).sqrt()
    for own in roots.unbind(dim=1):
        gentle = own[own < 0.8].sort().values  # of those that are not clipped
        assert len(gentle) >= 20
        assert gentle.diff().max() < 0.1


def test_every_warm_up_sets_out_in_every_direction() -> None:
    torch.manual_seed(0)
    warm_up = WarmUp(100, episodes=60)
    begun = torch.stack([fly(warm_up, 100, 3)[0] for _ in range(60)])
    for own in begun.unbind(dim=1):
        corners = {tuple(row) for row in own[own.abs().amin(dim=-1) == 1.0].tolist()}
        assert corners == {(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)}


def test_warm_ups_set_out_in_orders_of_their_own() -> None:
    torch.manual_seed(0)
    first = fly(WarmUp(4000, episodes=60), 4000, 1)[0]
    quadrants = [
        (first.sign() == torch.tensor(signs)).all(dim=-1).float().mean().item()
        for signs in ((1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0))
    ]
    assert quadrants == pytest.approx([0.25] * 4, abs=0.03)


def test_a_warm_up_keeps_its_heading() -> None:
    torch.manual_seed(0)
    warm_up = WarmUp(5000, episodes=30)
    flights = torch.stack([fly(warm_up, 5000, 20) for _ in range(30)])
    agreement = (flights[:, :-1].sign() == flights[:, 1:].sign()).float().mean()
    assert agreement > 0.85
    turned = (flights[:, 0].sign() != flights[:, -1].sign()).float().mean()
    assert turned > 0.1  # but not for ever
