"""Flying the best flight so far once more."""

import dataclasses

import pytest
import torch

from hyuav import Guide, InputError, RobustDDPG, Scenario
from hyuav.learning.ddpg import DDPG
from hyuav.learning.guide.demonstrations import Demonstrations
from hyuav.learning.guide.planner import Planner
from hyuav.learning.learners import Learner
from hyuav.learning.replay import latest
from hyuav.learning.train import Cohort
from hyuav.learning.training import Training, TrainingParameters

SCENARIO = dataclasses.replace(Scenario.preset("two_clusters"), num_slots=6)
LEARNERS = [Learner("hybrid", 1), Learner("jamming", 2), Learner("relay", 3)]


def cohort(repeat_every: int, warm_up_episodes: int = 0) -> Cohort:
    """Learners that repeat what earned most, and are not guided besides."""
    guide = Guide(
        warm_up_episodes=warm_up_episodes,
        update_every=max(repeat_every, 1),
        repeat_every=repeat_every,
        control_variate=False,
        imagined_flights=0,
        imitation_weight=0.0,
    )
    algorithm = RobustDDPG(hidden_sizes=(8,), noise_variance=0.6, noise_decay=1.0, guide=guide)
    return Cohort(SCENARIO, LEARNERS, algorithm, replay_size=20, batch_size=8, device=None)


def best(trained: Cohort) -> Demonstrations:
    """Of each learner."""
    planner = trained.algorithm.guide
    assert isinstance(planner, Planner)
    return planner.flights


def flown(trained: Cohort) -> torch.Tensor:
    """The actions (T, N, 2) of the last episode."""
    return torch.as_tensor(trained.stored["action"][latest(trained.replay, SCENARIO.num_slots)])


@pytest.mark.parametrize("compiled", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_every_nth_episode_takes_the_actions_of_each_learners_best(compiled: bool) -> None:
    trained = cohort(repeat_every=3, warm_up_episodes=2)
    rewards: list[torch.Tensor] = []
    flights: list[torch.Tensor] = []
    repeated = []
    for episode in range(1, 17):
        if compiled and episode == 4:
            trained.compile()
        reward, *_ = trained.fly()
        if episode in (3, 6, 9, 12, 15):
            first = torch.stack(rewards).argmax(dim=0)
            expected = torch.stack([flights[index][:, n] for n, index in enumerate(first)], dim=1)
            torch.testing.assert_close(flown(trained), expected)
            repeated.append(episode)
        rewards.append(reward)
        flights.append(flown(trained))
    assert repeated == [3, 6, 9, 12, 15]
    assert not torch.equal(flights[13], flights[11])


def test_without_repetition_no_flight_is_flown_twice() -> None:
    trained = cohort(repeat_every=0)
    flights = []
    for _ in range(6):
        trained.fly()
        flights.append(flown(trained))
    for index, flight in enumerate(flights):
        assert not any(torch.equal(flight, other) for other in flights[:index])


def test_the_best_flight_goes_on_with_a_training_that_is_resumed() -> None:
    first, second = cohort(repeat_every=2), cohort(repeat_every=2)
    for _ in range(5):
        first.fly()
    second.load_state_dict(first.state_dict())
    for trained in (first, second):
        trained.fly()
    assert torch.equal(flown(first), flown(second))
    assert torch.equal(best(first).best_return, best(second).best_return)


def test_the_best_flights_are_joined_at_once_or_as_soon_as_possible() -> None:
    flights = Demonstrations(2, SCENARIO, 0.005)
    observation = torch.zeros(2, 6, 16)
    observation[..., -1] = torch.arange(6) / 3.0 - 1.0  # of the slots 0 to 5
    assert torch.equal(flights.demonstrate(observation), torch.zeros(2, 6, 2))  # none yet: hover
    trajectory = 0.3 * torch.arange(24.0).reshape(6, 2, 2) / 24.0
    flights.keep(torch.zeros(6, 2, 2), trajectory, torch.zeros(2))
    expected = (trajectory.transpose(0, 1) / 0.2).clamp(-1.0, 1.0)
    torch.testing.assert_close(flights.demonstrate(observation), expected)
    observation[..., 0] = -0.9  # far to the left: at full speed to the right
    assert torch.equal(flights.demonstrate(observation)[..., 0], torch.ones(2, 6))


def test_the_powers_of_the_best_flight_are_taken_where_it_is_joined_and_where_it_is_not() -> None:
    starts = ((0.0, 0.0), (-60.0, -60.0))
    scenario = dataclasses.replace(SCENARIO, power_control=True, helper_starts=starts)
    flights = Demonstrations(1, scenario, 0.005)
    place = torch.tensor([0.1, 0.0, -0.7, -0.6, -0.5, 0.4])
    flights.keep(torch.zeros(6, 1, 6), place.expand(6, 1, 6), torch.zeros(1))
    observation = torch.zeros(1, 1, 31)
    observation[0, 0, :4] = torch.tensor([0.0, 0.0, -0.6, -0.6])
    joined = torch.tensor([[[0.5, 0.0, -0.7, 0.0, 0.5, 0.4]]])
    torch.testing.assert_close(flights.demonstrate(observation), joined)
    hovered = torch.tensor([[[0.0, 0.0, -0.7, 0.0, 0.0, 0.4]]])
    torch.testing.assert_close(flights.hover(observation), hovered)


def test_the_trajectory_of_the_best_flight_is_kept_with_its_actions() -> None:
    trained = cohort(repeat_every=3)
    for _ in range(4):
        trained.fly()
    flights, scale = best(trained), SCENARIO.max_speed / 100.0
    trajectory = flights.trajectory
    start = torch.tensor(SCENARIO.helper_starts[0]) / 100.0
    before = torch.cat([start.expand(1, 3, 2), trajectory[:-1]])
    flown = before + scale * flights.actions
    inside = flown.abs() <= 1.0
    torch.testing.assert_close(trajectory[inside], flown[inside])


def test_without_repetition_a_memory_may_be_shorter_than_a_flight() -> None:
    parameters = TrainingParameters(num_episodes=3, replay_size=5, batch_size=4)
    for episode in Training(SCENARIO, LEARNERS, DDPG(hidden_sizes=(8,)), parameters).episodes():
        assert episode.accumulated_reward.isfinite().all()


def test_a_memory_shorter_than_a_flight_is_refused() -> None:
    parameters = TrainingParameters(num_episodes=2, replay_size=5, batch_size=4)
    with pytest.raises(InputError, match="replay_size = 5: expected at least the 6 slots"):
        Training(SCENARIO, LEARNERS, RobustDDPG(), parameters)
