"""Training brings decisions nearer to the exact ones, from wherever it was stopped."""

import copy
import dataclasses

import pytest
import torch

from hyuav import family
from hyuav.learning.generalist.decide import Helpers, choices, moved
from hyuav.learning.generalist.lessons import Lesson, Lessons
from hyuav.learning.generalist.reinforcement import TEMPERATURE, bellman_error, explored
from hyuav.learning.generalist.scene import TURNS
from hyuav.learning.generalist.training import (
    GeneralistParameters,
    GeneralistTraining,
    imitation_loss,
)

SHORT = GeneralistParameters(steps=120, batch_size=64, evaluation_every=60, learning_rate=3e-3)


@pytest.fixture(scope="module")
def lessons() -> Lessons:
    return Lessons.of(Lesson.of(family("one", seed, "training")) for seed in (0, 2))


def judged(
    training: GeneralistTraining, lessons: Lessons, slots_left: int | None = None
) -> dict[str, float]:
    helpers = lessons.anywhere(256, torch.Generator().manual_seed(1))
    if slots_left is not None:
        helpers = helpers._replace(slots_left=torch.full_like(helpers.slots_left, slots_left))
    with torch.no_grad():
        loss = imitation_loss(training.network, lessons, helpers, TURNS[0])
    return {name: float(part) for name, part in loss._asdict().items()}


def test_decisions_come_nearer_to_the_exact_ones(lessons: Lessons) -> None:
    training = GeneralistTraining(lessons, lessons, SHORT)
    before = judged(training, lessons)
    progress = list(training.run())
    after = judged(training, lessons)
    assert after["regret"] < 0.8 * before["regret"]
    assert after["divergence"] < 0.9 * before["divergence"]
    assert [own.step for own in progress] == [60, 120]
    assert all(own.worst <= own.mean <= 1.01 for own in progress)


def test_values_come_to_agree_with_those_a_slot_later(lessons: Lessons) -> None:
    network = GeneralistTraining(lessons, lessons, SHORT).network
    delayed, optimizer = copy.deepcopy(network), torch.optim.Adam(network.parameters(), 1e-3)
    helpers = lessons.anywhere(64, torch.Generator().manual_seed(5))
    turn, errors = TURNS[0].expand(64, 2, 2), []
    for _ in range(40):
        generator = torch.Generator().manual_seed(6)
        error = bellman_error(network, delayed, lessons.world, helpers, turn, generator)
        errors.append(float(error.detach()))
        optimizer.zero_grad()
        error.backward()
        optimizer.step()
    assert errors[-1] < 0.5 * errors[0]


def test_values_of_the_last_slot_but_one_are_what_the_last_one_brings(lessons: Lessons) -> None:
    some = lessons.anywhere(32, torch.Generator().manual_seed(3))
    network, left = GeneralistTraining(lessons, lessons, SHORT).network, some.slots_left
    turn, errors = TURNS[0].expand(32, 2, 2), []
    for slots in (1, 2):
        helpers = Helpers(some.scene, some.place, torch.full_like(left, slots))
        generator = torch.Generator().manual_seed(4)
        choice = choices(network, lessons.world, helpers, turn)
        chosen = explored(choice, torch.Generator().manual_seed(4))
        told = (choice.worth - choice.rewards).gather(1, chosen)
        wanted = torch.zeros_like(told)
        for column, each in enumerate(chosen.unbind(dim=1) if slots == 2 else ()):
            later = choices(network, lessons.world, moved(helpers, each))
            policy = (later.worth / TEMPERATURE).softmax(dim=-1)
            wanted[:, column] = (policy * later.worth.clamp(min=0.0)).sum(dim=-1)
        expected = torch.nn.functional.smooth_l1_loss(told, wanted, beta=0.1)
        error = bellman_error(network, network, lessons.world, helpers, turn, generator)
        torch.testing.assert_close(error, expected)
        errors.append(float(error.detach()))
    assert errors[0] != errors[1]


def test_nothing_can_be_earned_after_the_last_slot(lessons: Lessons) -> None:
    some = lessons.anywhere(64, torch.Generator().manual_seed(2))
    last = Helpers(some.scene, some.place, torch.ones_like(some.slots_left))
    cells = torch.zeros(64, 1, dtype=torch.int64)
    assert torch.equal(lessons.values(last, cells), torch.zeros(64, 1))


@pytest.mark.parametrize("way", ["imitation", "both"])
def test_it_goes_on_where_it_was_stopped(lessons: Lessons, way: str) -> None:
    torch.set_num_threads(1)
    short = dataclasses.replace(SHORT, steps=40, evaluation_every=20, way=way)
    whole, again, resumed = (GeneralistTraining(lessons, lessons, short) for _ in range(3))
    list(whole.run())
    next(again.run())
    resumed.load_state_dict(again.state_dict())
    assert resumed.step == 20
    list(resumed.run())
    for name, weights in whole.network.state_dict().items():
        torch.testing.assert_close(resumed.network.state_dict()[name], weights, rtol=0, atol=0)
