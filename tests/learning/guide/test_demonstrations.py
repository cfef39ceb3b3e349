"""Flying the best flight so far once more."""

import dataclasses
from typing import Any

import pytest
import torch

from hyuav import InputError, Scenario
from hyuav.learning.ddpg import DDPG
from hyuav.learning.guide.demonstrations import BestFlights
from hyuav.learning.train import Cohort, Learner
from hyuav.learning.training import Training, TrainingParameters

SCENARIO = dataclasses.replace(Scenario.preset("two_clusters"), num_slots=6)
LEARNERS = [Learner("hybrid", 1), Learner("jamming", 2), Learner("relay", 3)]


def cohort(**hyperparameters: Any) -> Cohort:
    algorithm = DDPG(hidden_sizes=(8,), noise_decay=1.0, **hyperparameters)
    return Cohort(SCENARIO, LEARNERS, algorithm, replay_size=20, batch_size=8, device=None)


def best(trained: Cohort) -> BestFlights:
    """Of each learner."""
    assert trained.algorithm.best_flights is not None
    return trained.algorithm.best_flights


def flown(trained: Cohort) -> torch.Tensor:
    """The actions (T, N, 2) of the last episode."""
    slots = torch.arange(-SCENARIO.num_slots, 0) + trained.replay.writer._cursor
    return torch.as_tensor(trained.replay.storage._storage["action"][slots % 20])


@pytest.mark.parametrize("compiled", [False, True])
def test_every_nth_episode_takes_the_actions_of_each_learners_best(compiled: bool) -> None:
    trained = cohort(repeat_every=3, warm_up_episodes=2)
    rewards: list[torch.Tensor] = []
    flights: list[torch.Tensor] = []
    repeated = []
    for episode in range(1, 17):
        if compiled and episode == 4:
            trained.compile()
        reward, *_ = trained.fly()
        if trained.algorithm.repeats(episode):
            first = torch.stack(rewards).argmax(dim=0)
            expected = torch.stack([flights[index][:, n] for n, index in enumerate(first)], dim=1)
            torch.testing.assert_close(flown(trained), expected)
            repeated.append(episode)
        rewards.append(reward)
        flights.append(flown(trained))
    assert repeated == [3, 6, 9, 12, 15]
    assert not torch.equal(flights[13], flights[11])


def test_without_repetition_no_flight_is_flown_twice() -> None:
    trained = cohort()
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
    assert torch.equal(best(first).reward, best(second).reward)


def test_the_best_flights_are_joined_at_once_or_as_soon_as_possible() -> None:
    flights = BestFlights(2, SCENARIO)
    observation = torch.zeros(2, 6, 16)
    observation[..., -1] = torch.arange(6) / 3.0 - 1.0  # of the slots 0 to 5
    assert torch.equal(flights.towards(observation), torch.zeros(2, 6, 2))  # none yet: hover
    way = 0.3 * torch.arange(24.0).reshape(6, 2, 2) / 24.0
    flights.keep(torch.zeros(6, 2, 2), way, torch.zeros(2))
    expected = (way.transpose(0, 1) / 0.2).clamp(-1.0, 1.0)
    torch.testing.assert_close(flights.towards(observation), expected)
    observation[..., 0] = -0.9  # far to the left: at full speed to the right
    assert torch.equal(flights.towards(observation)[..., 0], torch.ones(2, 6))


def test_the_way_of_the_best_flight_is_kept_with_its_actions() -> None:
    trained = cohort(repeat_every=3)
    for _ in range(4):
        trained.fly()
    flights, scale = best(trained), SCENARIO.max_speed / 100.0
    way = flights.way
    start = torch.tensor(SCENARIO.helper_start) / 100.0
    before = torch.cat([start.expand(1, 3, 2), way[:-1]])
    flown = before + scale * flights.actions
    inside = flown.abs() <= 1.0
    torch.testing.assert_close(way[inside], flown[inside])


def test_without_repetition_a_memory_may_be_shorter_than_a_flight() -> None:
    parameters = TrainingParameters(num_episodes=3, replay_size=5, batch_size=4)
    for episode in Training(SCENARIO, LEARNERS, DDPG(hidden_sizes=(8,)), parameters).episodes():
        assert episode.accumulated_reward.isfinite().all()


def test_a_memory_shorter_than_a_flight_is_refused() -> None:
    parameters = TrainingParameters(num_episodes=2, replay_size=5, batch_size=4)
    with pytest.raises(InputError, match="replay_size = 5: expected at least the 6 slots"):
        Training(SCENARIO, LEARNERS, DDPG(repeat_every=2), parameters)
