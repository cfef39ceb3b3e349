"""Flights that are judged before they are flown."""

import dataclasses
from typing import Any

import pytest
import torch
from torch import Tensor

from hyuav import Scenario, make_env
from hyuav.learning.algorithms import DDPG
from hyuav.learning.cohort import Cohort, Learner
from hyuav.learning.control_variate import ControlVariate
from hyuav.learning.imagination import Imagination
from hyuav.learning.repetition import BestFlights
from hyuav.system import SecureOffloadingSystem

SCENARIO = dataclasses.replace(Scenario.preset("two_clusters"), num_slots=6)


class FarIsBetter(ControlVariate):
    """Expects of a slot as much as the helper is far along x, and of the second learner -x."""

    def forward(self, place: Tensor, clock: Tensor) -> tuple[Tensor, Tensor]:
        signs = torch.tensor([1.0, -1.0]).reshape(-1, *[1] * (place.ndim - 1))
        return place[..., :1] * signs, clock


DEAR = {"jamming_power": 1000.0}  # a helper that may jam has less left to fly
SMALL = {
    "map_side": 60.0,
    "max_speed": 19.0,
    "helper_start": (-10.0, -10.0),
    "legitimate_position": (0.0, 0.0),
    "eavesdropper_position": (20.0, 20.0),
    "ue_positions": ((5.0, 6.0), (-7.0, 8.0)),
}


@pytest.mark.parametrize("changes", [{}, {"speed_limit": "disc"}, DEAR, SMALL])
@pytest.mark.parametrize("geofence", [False, True])
def test_the_environment_flies_what_was_imagined(changes: dict[str, Any], geofence: bool) -> None:
    scenario = dataclasses.replace(SCENARIO, **changes)
    schemes = ["hybrid", "relay"]
    actions, way = Imagination(70, SecureOffloadingSystem(scenario), schemes).fly(3)
    assert actions.shape == way.shape == (6, 2, 70, 2)
    env = make_env(scenario, schemes, (2, 70), seed=0, geofence=geofence)
    state, half_side = env.reset(), scenario.map_side / 2
    for action, place in zip(actions, way, strict=True):
        state = env.step_mdp(env.step(state.set("action", action)))
        assert not state["off_map"].any()
        torch.testing.assert_close(state["position"], place * half_side, atol=1e-3, rtol=0.0)
    assert torch.equal(way[:, 0], way[:, 1]) == (changes != DEAR)


def test_other_flights_are_imagined_in_every_episode_and_they_cover_what_can_be_reached() -> None:
    system = SecureOffloadingSystem(dataclasses.replace(SCENARIO, num_slots=10))
    imagination = Imagination(50, system, ["hybrid"])
    ends = torch.stack([imagination.fly(episode)[1][-1, 0] for episode in range(40)]).flatten(0, 1)
    assert len(ends.unique(dim=0)) > 0.5 * len(ends)  # those at the edges coincide
    for corner in ((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (0.0, 0.0), (-0.5, 0.6)):
        assert (ends - torch.tensor(corner)).norm(dim=-1).min() < 0.05


def test_of_the_flights_the_one_of_which_most_is_expected_becomes_each_learners_best() -> None:
    best = BestFlights(2, SCENARIO)
    imagination = Imagination(40, SecureOffloadingSystem(SCENARIO), ["hybrid", "hybrid"])
    variate = FarIsBetter(2, SCENARIO, 1.0, clock=True)
    imagination.improve(best, variate, 1)
    actions, way = imagination.fly(1)
    for learner, sign in enumerate((1.0, -1.0)):
        sums = sign * way[..., learner, :, 0].sum(dim=0)
        assert best.reward[learner] == sums.max()
        assert torch.equal(best.way[:, learner], way[:, learner, sums.argmax()])
        assert torch.equal(best.actions[:, learner], actions[:, learner, sums.argmax()])
    kept = best.actions.clone()
    best.reward += 100.0
    imagination.improve(best, variate, 2)
    assert torch.equal(best.actions, kept)


@pytest.mark.parametrize("compiled", [False, True])
def test_what_was_imagined_is_flown_after_the_warm_up(
    compiled: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    def far(_: ControlVariate, way: Tensor) -> Tensor:
        return way[..., 0].sum(dim=0) + way[-1, ..., 1]  # and no two flights as far

    monkeypatch.setattr(ControlVariate, "expected", far)
    algorithm = DDPG(
        hidden_sizes=(8,),
        clock=True,
        control_variate=True,
        warm_up_episodes=3,
        repeat_every=2,
        imagined_flights=100,
    )
    trained = Cohort(SCENARIO, [Learner("jamming", 1)], algorithm, 60, 8, None)
    for _ in range(3):
        trained.fly()
    if compiled:
        trained.compile()
    trained.fly()
    actions, way = Imagination(100, SecureOffloadingSystem(SCENARIO), ["jamming"]).fly(3)
    farthest = (way[:, 0, :, 0].sum(dim=0) + way[-1, 0, :, 1]).argmax()
    stored = trained.replay.storage._storage["action"][18:24, 0]
    torch.testing.assert_close(stored, actions[:, 0, farthest])
