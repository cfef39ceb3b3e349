"""Training brings decisions nearer to the exact ones, from wherever it was stopped."""

import pytest
import torch

from hyuav import family
from hyuav.learning.generalist.decide import Helpers
from hyuav.learning.generalist.lessons import Lesson, Lessons
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


def judged(training: GeneralistTraining, lessons: Lessons) -> dict[str, float]:
    helpers = lessons.anywhere(256, torch.Generator().manual_seed(1))
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


def test_nothing_can_be_earned_after_the_last_slot(lessons: Lessons) -> None:
    some = lessons.anywhere(64, torch.Generator().manual_seed(2))
    last = Helpers(some.scene, some.place, torch.ones_like(some.slots_left))
    cells = torch.zeros(64, 1, dtype=torch.int64)
    assert torch.equal(lessons.values(last, cells), torch.zeros(64, 1))


def test_it_goes_on_where_it_was_stopped(lessons: Lessons) -> None:
    torch.set_num_threads(1)
    whole, again, resumed = (GeneralistTraining(lessons, lessons, SHORT) for _ in range(3))
    list(whole.run())
    next(again.run())
    resumed.load_state_dict(again.state_dict())
    assert resumed.step == 60
    list(resumed.run())
    for name, weights in whole.network.state_dict().items():
        torch.testing.assert_close(resumed.network.state_dict()[name], weights, rtol=0, atol=0)
