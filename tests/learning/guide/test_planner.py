"""Which flights are kept, tried and joined."""

import copy
import dataclasses
from typing import Any

import pytest
import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor

from hyuav import Scenario
from hyuav.learning.ddpg import DDPG
from hyuav.learning.guide.control_variate import ControlVariate
from hyuav.learning.guide.demonstrations import AHEAD, BestFlights
from hyuav.learning.guide.planner import FlightSearch
from hyuav.learning.guide.proposals import Imagination
from hyuav.learning.guide.reward_model import Expectation
from hyuav.learning.train import Cohort, Learner
from hyuav.physics.slot import SecureOffloadingSystem

SCENARIO = dataclasses.replace(Scenario.preset("two_clusters"), num_slots=6)


class FarIsBetter(Expectation):
    """Expects as much as the helper is far along x, and guesses as much as it is along -y."""

    def __init__(self, learners: int) -> None:
        variate = ControlVariate(learners, SCENARIO, 1.0, clock=True)
        super().__init__(learners, variate, 1.0)
        self.updates = 0

    def update(self, memory: TensorDictBase, normals: Tensor) -> None:  # noqa: ARG002
        self.updates += 1

    def of(self, way: Tensor) -> tuple[Tensor, Tensor]:
        x, y = way.sum(dim=0).unbind(dim=-1)
        return x, -y


def flown(x: float, learners: int = 2) -> TensorDictBase:
    """An episode that ended in every slot at (x, 0)."""
    place = torch.tensor([x, 0.0]).expand(6, learners, 2)
    after = TensorDict(observation=place, batch_size=[6, learners])
    action = torch.full((6, learners, 2), x)
    return TensorDict(action=action, next=after, batch_size=[6, learners])


def search(imagined: int = 0) -> tuple[FlightSearch, BestFlights, FarIsBetter]:
    flights, expectation = BestFlights(2, SCENARIO), FarIsBetter(2)
    system = SecureOffloadingSystem(SCENARIO)
    imagination = Imagination(imagined, system, ["hybrid"] * 2) if imagined else None
    return FlightSearch(flights, expectation, imagination, [1, 2]), flights, expectation


def test_the_flight_of_which_most_is_expected_is_kept_and_tried() -> None:
    searching, flights, expectation = search()
    for episode, x in enumerate([-0.2, 0.4, 0.1], start=1):
        searching.go_on(flown(x), flown(x), episode, imagines=True)
    assert torch.equal(flights.way, flown(0.4)["next", "observation"])
    assert torch.equal(flights.tried_actions, flown(0.4)["action"])
    torch.testing.assert_close(flights.reward, torch.full((2,), 2.4))
    assert expectation.updates == 1


def test_of_the_imagined_ones_the_best_is_kept_and_that_of_the_best_guess_tried() -> None:
    searching, flights, _ = search(imagined=30)
    searching.go_on(flown(-0.6), flown(-0.6), 3, imagines=True)
    far = (flights.way[-1, :, 0] > 0.3).all()  # six slots from the start at -0.6
    low = (flights.tried_way[-1, :, 1] < -0.9).all()
    assert far
    assert low
    torch.testing.assert_close(flights.reward, flights.way[..., 0].sum(dim=0))


def test_nothing_is_imagined_during_the_warm_up() -> None:
    searching, flights, _ = search(imagined=30)
    searching.go_on(flown(-0.6), flown(-0.6), 3, imagines=False)
    assert torch.equal(flights.tried_way, flown(-0.6)["next", "observation"])


@pytest.mark.parametrize(("share", "behind"), [(1.0 - 2.0 * AHEAD, True), (1.0, False)])
def test_who_flies_clearly_worse_than_the_best_flight_is_behind(share: float, behind: bool) -> None:
    searching, flights, _ = search()
    searching.go_on(flown(0.5), flown(0.5), 1, imagines=False)
    assert not flights.behind.any()  # no actor was evaluated yet
    flights.own_way.copy_(share * flights.way)
    searching.go_on(flown(0.1), flown(0.1), 2, imagines=False)
    assert flights.behind.tolist() == [behind] * 2


def cohort(**hyperparameters: Any) -> Cohort:
    algorithm = DDPG(
        hidden_sizes=(8,),
        clock=True,
        control_variate=True,
        warm_up_episodes=3,
        repeat_every=2,
        imagined_flights=40,
        **hyperparameters,
    )
    learners = [Learner("jamming", 1), Learner("hybrid", 2)]
    return Cohort(SCENARIO, learners, algorithm, 60, 8, None)


def best(trained: Cohort) -> BestFlights:
    assert trained.algorithm.best_flights is not None
    return trained.algorithm.best_flights


@pytest.mark.parametrize("compiled", [False, True])
def test_what_was_imagined_is_flown_after_the_warm_up(
    compiled: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Expectation, "of", FarIsBetter.of)
    trained = cohort()
    for _ in range(3):
        trained.fly()
    tried = best(trained).tried_actions.clone()
    assert (best(trained).tried_way[-1, :, 1] < -0.9).all()
    if compiled:
        trained.compile()
    trained.fly()
    stored = trained.replay.storage._storage["action"][18:24]
    torch.testing.assert_close(stored, tried)


def test_the_search_goes_on_with_a_training_that_is_resumed() -> None:
    first, second = cohort(), cohort()
    for _ in range(6):
        first.fly()
    first.keep_best(first.evaluate(10, seed=0))
    second.load_state_dict(copy.deepcopy(first.state_dict()))  # not one memory for both
    for trained in (first, second):
        for _ in range(5):
            trained.fly()
    for name, values in best(first).state_dict().items():
        torch.testing.assert_close(values, best(second).state_dict()[name], rtol=0.0, atol=0.0)
    assert not torch.equal(best(first).tried_way, best(first).way)
