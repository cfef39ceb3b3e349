"""Which flights are kept, planned and joined."""

import copy
import dataclasses

import pytest
import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor

from hyuav import Guide, InputError, RobustDDPG, RobustSAC, RobustTD3, Scenario, make_env
from hyuav.envs.observation import ObservationLayout
from hyuav.learning.guide.demonstrations import Demonstrations
from hyuav.learning.guide.parameters import OFF
from hyuav.learning.guide.planner import Planner
from hyuav.learning.guide.reward_model import RewardModel
from hyuav.learning.guide.robust import Robust
from hyuav.learning.learners import Learner
from hyuav.learning.train import Cohort

SCENARIO = dataclasses.replace(Scenario.preset("two_clusters"), num_slots=6)
GUIDE = Guide(warm_up_episodes=3)


def far_is_better(_: RewardModel, trajectory: Tensor) -> tuple[Tensor, Tensor]:
    """Expect as much as the helper is far along x, and guess as much as it is along -y."""
    x, y = trajectory.sum(dim=0).unbind(dim=-1)
    return x, -y


@pytest.fixture
def updates(monkeypatch: pytest.MonkeyPatch) -> list[Tensor]:
    """The numbers by which a reward model that knows its answers was updated."""
    made: list[Tensor] = []
    monkeypatch.setattr(RewardModel, "judge", far_is_better)
    monkeypatch.setattr(RewardModel, "update", lambda *given: made.append(given[-1]))
    return made


def flown(x: float, learners: int = 2) -> TensorDictBase:
    """An episode that ended in every slot at (x, 0)."""
    place = torch.tensor([x, 0.0]).expand(6, learners, 2)
    after = TensorDict(observation=place, batch_size=[6, learners])
    action = torch.full((6, learners, 2), x)
    return TensorDict(action=action, next=after, batch_size=[6, learners])


def planner(imagined: int = 0) -> Planner:
    env = make_env(SCENARIO, ["hybrid"] * 2, (2,), seed=[1, 2], clock=True)
    guide = dataclasses.replace(GUIDE, imagined_flights=imagined)
    return Planner(guide, RobustDDPG(guide=guide), env, [1, 2])


def test_the_flight_of_which_most_is_expected_is_kept_and_planned(updates: list[Tensor]) -> None:
    planning = planner()
    for episode, x in enumerate([-0.2, 0.4, 0.1], start=1):
        planning.end_episode(episode, flown(x), flown(x))
    flights = planning.flights
    assert torch.equal(flights.trajectory, flown(0.4)["next", "observation"])
    assert torch.equal(flights.planned_actions, flown(0.4)["action"])
    torch.testing.assert_close(flights.best_return, torch.full((2,), 2.4))
    assert len(updates) == 1


@pytest.mark.usefixtures("updates")
def test_of_the_imagined_ones_the_best_is_kept_and_that_of_the_best_guess_planned() -> None:
    planning = planner(imagined=30)
    planning.end_episode(7, flown(-0.6), flown(-0.6))
    flights = planning.flights
    far = (flights.trajectory[-1, :, 0] > 0.3).all()  # six slots from the start at -0.6
    low = (flights.planned_trajectory[-1, :, 1] < -0.9).all()
    assert far
    assert low
    torch.testing.assert_close(flights.best_return, flights.trajectory[..., 0].sum(dim=0))


def test_of_the_powers_that_are_tried_the_best_is_kept_and_that_of_the_best_guess_planned(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """With two helpers in turn, from episode to episode."""

    def at_a_power(_: RewardModel, slots: Tensor) -> Tensor:
        """Expect most of -12 dB and -48 dB, and guess 24 dB more and 24 dB less."""
        best = torch.tensor([[0.6, -0.6], [-0.2, 0.2]], device=slots.device)
        return -(slots.unsqueeze(-2)[..., 2::3] - best).square().sum(dim=-1)

    monkeypatch.setattr(RewardModel, "judge", lambda m, t: at_a_power(m, t).sum(dim=0).unbind(-1))

    def choose(model: RewardModel, candidates: Tensor) -> list[tuple[Tensor, Tensor]]:
        values, index = at_a_power(model, candidates).max(dim=-2)
        return [*zip(values.sum(dim=0).unbind(-1), index.unbind(-1), strict=True)]

    monkeypatch.setattr(RewardModel, "choose", choose)
    monkeypatch.setattr(RewardModel, "update", lambda *_: None)
    starts = ((-60.0, -60.0), (60.0, -60.0))
    scenario = dataclasses.replace(SCENARIO, helper_starts=starts, power_control=True)
    env = make_env(scenario, ["hybrid"] * 2, (2,), seed=[1, 2], clock=True)
    planning, action = Planner(GUIDE, RobustDDPG(guide=GUIDE), env, [1, 2]), torch.zeros(2, 6)
    slots = [env.step(env.reset().set("action", action)) for _ in range(6)]
    flown = TensorDict.stack(slots).select("action", ("next", "observation"), ("next", "reward"))
    for episode in range(4, 16):
        planning.end_episode(episode, flown, flown)
    flights = planning.flights
    assert torch.equal(flights.trajectory[..., 2::3], flights.actions[..., 2::3])
    error = (flights.actions[..., 2::3] - torch.tensor([0.6, -0.6])).abs()
    assert error.max() < 0.06
    error = (flights.planned_actions[..., 2::3] - torch.tensor([-0.2, 0.2])).abs()
    assert error.max() < 0.3


@pytest.mark.usefixtures("updates")
def test_nothing_is_imagined_during_the_warm_up() -> None:
    planning = planner(imagined=30)
    planning.guide = dataclasses.replace(planning.guide, warm_up_episodes=4)
    planning.end_episode(3, flown(-0.6), flown(-0.6))
    flights = planning.flights
    assert torch.equal(flights.planned_trajectory, flown(-0.6)["next", "observation"])


@pytest.mark.usefixtures("updates")
@pytest.mark.parametrize(
    ("share", "behind"), [(1.0 - 2.0 * Guide().return_margin, True), (1.0, False)]
)
def test_who_flies_clearly_worse_than_the_best_flight_is_behind(share: float, behind: bool) -> None:
    planning = planner()
    flights = planning.flights
    planning.end_episode(1, flown(0.5), flown(0.5))
    assert not flights.behind.any()  # no actor was evaluated yet
    planning.end_evaluation(share * flights.trajectory)
    planning.end_episode(2, flown(0.1), flown(0.1))
    assert flights.behind.tolist() == [behind] * 2


def cohort(scenario: Scenario = SCENARIO, kind: type[Robust] = RobustDDPG) -> Cohort:
    guide = Guide(warm_up_episodes=3, update_every=2, repeat_every=2, imagined_flights=40)
    algorithm = kind(hidden_sizes=(8,), guide=guide)
    learners = [Learner("jamming", 1), Learner("hybrid", 2)]
    return Cohort(scenario, learners, algorithm, 60, 8, None)


def best(trained: Cohort) -> Demonstrations:
    planning = trained.algorithm.guide
    assert isinstance(planning, Planner)
    return planning.flights


@pytest.mark.parametrize("compiled", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_what_was_imagined_is_flown_after_the_warm_up(
    compiled: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(RewardModel, "judge", far_is_better)
    trained = cohort()
    for _ in range(3):
        trained.fly()
    planned = best(trained).planned_actions.clone()
    assert (best(trained).planned_trajectory[-1, :, 1] < -0.9).all()
    if compiled:
        trained.compile()
    trained.fly()
    stored = trained.stored["action"][18:24]
    torch.testing.assert_close(stored, planned)


@pytest.mark.parametrize("kind", [RobustDDPG, RobustTD3, RobustSAC])
def test_several_helpers_fly_what_was_imagined_at_the_powers_that_were_planned(
    kind: type[Robust],
) -> None:
    starts = ((-60.0, -60.0), (60.0, -60.0))
    scenario = dataclasses.replace(SCENARIO, helper_starts=starts, power_control=True)
    trained = cohort(scenario, kind)
    for _ in range(3):
        trained.fly()
    planned, led = best(trained).planned_actions.clone(), best(trained).planned_trajectory.clone()
    assert planned.shape == (6, 2, 6)
    trained.fly()
    flown = trained.stored[18:24]
    torch.testing.assert_close(flown["action"], planned)
    place = ObservationLayout(scenario, clock=True).place(flown)
    torch.testing.assert_close(place, led, rtol=0.0, atol=1e-5)
    trained.keep_best(4, seed=0)
    own = best(trained).own_trajectory.unflatten(-1, (2, 3))
    assert own.isfinite().all()
    assert (own[:, :, 0] != own[:, :, 1]).all()
    trained.fly()
    assert not trained.stopped.any()


def test_the_planner_goes_on_with_a_training_that_is_resumed() -> None:
    first, second = cohort(), cohort()
    for _ in range(6):
        first.fly()
    first.keep_best(10, seed=0)
    second.load_state_dict(copy.deepcopy(first.state_dict()))  # not one memory for both
    for trained in (first, second):
        for _ in range(5):
            trained.fly()
    for name, values in best(first).state_dict().items():
        torch.testing.assert_close(values, best(second).state_dict()[name], rtol=0.0, atol=0.0)
    assert not torch.equal(best(first).planned_trajectory, best(first).trajectory)


def test_a_flight_is_planned_in_the_episode_before_the_one_that_flies_it() -> None:
    for every in (1, 2, 4):
        guide = Guide(warm_up_episodes=7, update_every=every, repeat_every=4)
        repeated = [episode for episode in range(1, 30) if guide.repeats(episode)]
        assert repeated == [8, 12, 16, 20, 24, 28]
        assert all(guide.updates(episode - 1) for episode in repeated)
    refusal = "^repeat_every = 6: expected a multiple of update_every = 4, or 0$"
    with pytest.raises(InputError, match=refusal):
        Guide(repeat_every=6)


@pytest.mark.parametrize(
    "off", [{"control_variate": False}, {"repeat_every": 0, "imitation_weight": 0.0}]
)
def test_flights_are_not_imagined_in_vain(off: dict[str, float]) -> None:
    with pytest.raises(InputError, match=r"^imagined_flights = 64: expected 0 without"):
        Guide(**off)  # type: ignore[arg-type]


@pytest.mark.parametrize("piece", list(OFF))
def test_a_guide_does_without_any_piece(piece: str) -> None:
    guide = Guide(warm_up_episodes=3).without(piece)
    assert not getattr(guide, piece)
    algorithm = RobustDDPG(hidden_sizes=(8,), guide=guide)
    trained = Cohort(SCENARIO, [Learner("jamming", 1)], algorithm, 60, 8, None)
    for _ in range(5):
        trained.fly()
    assert not trained.stopped.any()
