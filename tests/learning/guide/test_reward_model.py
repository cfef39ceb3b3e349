"""What is to be expected of flights, by all that is remembered."""

import dataclasses

import pytest
import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor

from hyuav import Guide, Scenario
from hyuav.learning.afterstate import Afterstate
from hyuav.learning.guide.control_variate import ControlVariate
from hyuav.learning.guide.reward_model import RewardModel
from hyuav.physics.layout import disk

SCENARIO = dataclasses.replace(Scenario.preset("two_clusters"), num_slots=5)
MOST = Guide().most_ue_features
UES = torch.tensor(SCENARIO.ue_positions)
POWERS = 3 * SCENARIO.num_ues + 2


def reward_model(
    learners: int = 1, scale: float = 0.05, scenario: Scenario = SCENARIO
) -> RewardModel:
    torch.manual_seed(0)
    afterstate = Afterstate(scenario, 0.02, clock=True, geofence=True)
    variate = ControlVariate(learners, scenario, afterstate, (64, 64), scale)
    return RewardModel(learners, variate, scale, Guide())


def earned(place: Tensor) -> Tensor:
    """bps/Hz at places (..., 2) in units of half the map's side, by how many UEs are covered."""
    distances = torch.linalg.vector_norm(place.unsqueeze(-2) * 100.0 - UES, dim=-1)
    return (distances <= SCENARIO.coverage_radius).float().sum(dim=-1, keepdim=True) + place[
        ..., :1
    ]


def memory(places: Tensor, scale: float = 0.05) -> TensorDictBase:
    """Slots (n, N) without chance that ended at ``places`` (n, N, 2)."""
    clock = torch.rand(len(places), 1, 1, generator=torch.Generator().manual_seed(3)) * 2.0 - 1.0
    clock = clock.expand(*places.shape[:-1], 1)
    after = TensorDict(
        observation=torch.cat([places, clock], dim=-1),
        reward=scale * earned(places),
        fading=torch.ones(*places.shape[:-1], POWERS),
        batch_size=places.shape[:-1],
    )
    return TensorDict(next=after, batch_size=places.shape[:-1])


def around(center: tuple[float, float], spread: float, learners: int = 1) -> Tensor:
    generator = torch.Generator().manual_seed(1)
    normal = torch.randn(400, learners, 2, generator=generator)
    return (torch.tensor(center) + spread * normal).clamp(-1.0, 1.0)


def test_it_finds_a_sliver_of_coverage_that_was_never_visited() -> None:
    regression = reward_model()
    places = around((-0.1, 0.0), 0.4)
    visited = earned(places).max()
    regression.update(memory(places), torch.zeros(1, regression.size))
    x, y = torch.meshgrid(
        torch.linspace(-0.6, 0.4, 81), torch.linspace(-0.5, 0.5, 81), indexing="ij"
    )
    grid = torch.stack([x, y], dim=-1).reshape(1, 1, -1, 2)
    expected, _ = regression.judge(grid)
    truth = earned(grid).squeeze()
    assert truth.max() >= visited
    error = (expected.squeeze() - truth).abs()
    assert error.quantile(0.95) < 0.15  # but for places at an edge, or far out
    assert truth[expected.argmax()] == pytest.approx(truth.max().item(), abs=0.05)


def test_a_flight_is_worth_the_sum_of_its_slots() -> None:
    regression = reward_model(2)
    regression.update(memory(around((0.0, 0.0), 0.3, 2)), torch.zeros(2, regression.size))
    trajectory = torch.linspace(-0.3, 0.3, 5).reshape(5, 1, 1, 1).expand(5, 2, 3, 2)
    expected, guessed = regression.judge(trajectory)
    assert expected.shape == guessed.shape == (2, 3)
    truth = earned(trajectory).squeeze(-1).sum(dim=0)
    torch.testing.assert_close(expected, truth, atol=0.4, rtol=0.0)


def test_of_candidates_that_of_which_most_is_expected_is_chosen_in_each_slot() -> None:
    regression = reward_model(2)
    normals = torch.randn(2, regression.size, generator=torch.Generator().manual_seed(4))
    regression.update(memory(around((0.0, 0.0), 0.3, 2)), normals)
    candidates = torch.rand(5, 2, 3, 4, 2, generator=torch.Generator().manual_seed(5)) - 0.5
    for number, (value, chosen) in enumerate(regression.choose(candidates)):
        flight = torch.take_along_dim(candidates, chosen[..., None, None], dim=3).squeeze(3)
        worth = regression.judge(flight)[number]
        torch.testing.assert_close(value, worth)
        for other in range(4):
            for slot in range(5):
                changed = flight.clone()
                changed[slot] = candidates[slot, :, :, other]
                assert (worth >= regression.judge(changed)[number] - 1e-4).all()


@pytest.mark.parametrize(("slope", "best"), [(-2.0, 0), (2.0, 2)])
def test_what_the_power_adds_is_learned(slope: float, best: int) -> None:
    regression = reward_model(scenario=dataclasses.replace(SCENARIO, power_control=True))
    places = around((0.0, 0.0), 0.3)
    power = torch.linspace(-1.0, 1.0, len(places)).reshape(-1, 1, 1)
    slots = memory(places)
    slots["action"] = torch.cat([torch.zeros_like(places), power], dim=-1)
    slots["next", "reward"] = 0.05 * (earned(places) + slope * power)
    regression.update(slots, torch.zeros(1, regression.size))
    place = torch.tensor([-0.3, 0.1]).expand(3, 2)
    tried = torch.cat([place, torch.tensor([[-0.8], [0.0], [0.8]])], dim=-1).reshape(1, 1, 1, 3, 3)
    assert regression.choose(tried)[0][1].item() == best


def test_guesses_differ_where_little_is_known() -> None:
    regression = reward_model()
    known, unknown = (-0.3, 0.1), (0.9, -0.9)
    trajectory = torch.tensor([known, unknown]).reshape(1, 1, 2, 2)
    guesses = []
    slots = memory(around(known, 0.1))
    noise = torch.randn(400, 1, 1, generator=torch.Generator().manual_seed(2))
    slots["next", "reward"] += 0.05 * 0.3 * noise
    for _ in range(3):  # until it knows how much is noise
        regression.update(slots, torch.zeros(1, regression.size))
    assert regression.noise.item() == pytest.approx(0.3**2, rel=0.2)
    for seed in range(40):
        normals = torch.randn(1, regression.size, generator=torch.Generator().manual_seed(seed))
        regression.update(slots, normals)
        guesses.append(regression.judge(trajectory)[1].squeeze(0))
    spread = torch.stack(guesses).std(dim=0)
    assert spread[1] > 10.0 * spread[0]


def test_without_normals_a_guess_is_what_is_expected() -> None:
    regression = reward_model()
    regression.update(memory(around((0.0, 0.0), 0.3)), torch.zeros(1, regression.size))
    assert torch.equal(regression.mean, regression.guess)
    assert regression.mean.any()


def test_what_cannot_be_solved_leaves_that_learner_as_it_was() -> None:
    regression = reward_model(2)
    slots = memory(around((0.0, 0.0), 0.3, 2))
    slots["next", "reward"][:, 0] = torch.nan
    regression.update(slots, torch.zeros(2, regression.size))
    assert not regression.mean[0].any()
    assert regression.mean[1].any()
    assert regression.noise.isfinite().all()


def test_a_memory_of_one_place_alone_can_be_learned_from() -> None:
    regression = reward_model()
    slots = memory(torch.zeros(20, 1, 2)).apply(torch.zeros_like)
    for _ in range(3):
        regression.update(slots, torch.ones(1, regression.size))
    assert regression.mean.isfinite().all()
    assert regression.guess.isfinite().all()
    assert regression.noise.isfinite().all()


def test_learners_share_nothing() -> None:
    places = around((0.0, 0.0), 0.3, 2)
    together, alone = reward_model(2), reward_model(2)
    normals = torch.randn(2, together.size)
    together.update(memory(places), normals)
    other = places.clone()
    other[:, 0] *= -1.0
    alone.update(memory(other), normals)
    torch.testing.assert_close(together.guess[1], alone.guess[1])
    assert not torch.allclose(together.guess[0], alone.guess[0])


def test_many_ues_have_no_features_of_their_own() -> None:
    crowd = dataclasses.replace(SCENARIO, ue_positions=disk(MOST + 1, seed=0))
    few = dataclasses.replace(SCENARIO, ue_positions=disk(MOST, seed=0))
    assert reward_model(scenario=few).size > 6 * MOST
    regression = reward_model(scenario=crowd)
    assert regression.size == reward_model().size - 6 * SCENARIO.num_ues
    assert regression.features(torch.zeros(1, 3, 2), torch.zeros(1, 3, 1)).shape == (
        1,
        3,
        regression.size,
    )
