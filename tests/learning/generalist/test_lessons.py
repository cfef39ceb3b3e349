"""Lessons are what dynamic programming says, and flights earn what they tell."""

import dataclasses

import pytest
import torch

from hyuav import family, solve_optimum
from hyuav.learning.generalist.decide import Helpers, flights
from hyuav.learning.generalist.lessons import Lesson, Lessons
from hyuav.learning.generalist.network import GeneralistNetwork
from hyuav.learning.generalist.scene import REACH, TURNS, window
from hyuav.physics.scenario_families import Ruled

SEEDS = (1, 4, 6)


@pytest.fixture(scope="module")
def ruled() -> list[Ruled]:
    drawn = [family("one", seed) for seed in SEEDS]
    return [
        own._replace(scenario=dataclasses.replace(own.scenario, fading=False, power_control=False))
        for own in drawn
    ]


@pytest.fixture(scope="module")
def lessons(ruled: list[Ruled]) -> list[Lesson]:
    return [Lesson.of(own) for own in ruled]


def test_a_lesson_knows_the_optimum(ruled: list[Ruled], lessons: list[Lesson]) -> None:
    for own, lesson in zip(ruled, lessons, strict=True):
        exact = solve_optimum(own.scenario, [own.mode_rule], resolution=2.0)[own.mode_rule].value
        told = lesson.optimum * float(lesson.scene.best)
        assert told == pytest.approx(exact, rel=2e-3)


def test_the_best_candidates_lead_to_the_optimum(lessons: list[Lesson]) -> None:
    several = Lessons.of(lessons)
    scenes = several.world.scenes
    scene = torch.arange(scenes.count)
    helpers = Helpers(scene, scenes.start, scenes.num_slots.squeeze(-1))
    index = window(scenes.side, scenes.start, 1, REACH, TURNS[0].expand(scenes.count, 2, 2))
    rewards = scenes.rewards_at(scene, index)
    worth = (rewards + several.values(helpers, index)).where(rewards >= 0, -torch.inf)
    torch.testing.assert_close(worth.amax(dim=-1), several.optimum, rtol=2e-3, atol=0.0)


def test_a_lesson_is_kept_and_read_again(ruled: list[Ruled], lessons: list[Lesson]) -> None:
    again = Lesson.from_state(ruled[0], lessons[0].state_dict())
    assert again.optimum == lessons[0].optimum
    assert torch.equal(again.scene.rewards, lessons[0].scene.rewards)


def test_helpers_anywhere_are_where_flights_can_have_led(lessons: list[Lesson]) -> None:
    several = Lessons.of(lessons)
    helpers = several.anywhere(2000, torch.Generator().manual_seed(0))
    scenes = several.world.scenes
    flown = scenes.num_slots[helpers.scene].squeeze(-1) - helpers.slots_left
    far = (helpers.place - scenes.start[helpers.scene]).abs().amax(dim=-1)
    assert (far <= 10 * flown).all()
    assert helpers.slots_left.min() == 1
    assert ((helpers.place >= 0) & (helpers.place < scenes.side)).all()


def test_a_flight_earns_no_more_than_the_optimum(lessons: list[Lesson]) -> None:
    several = Lessons.of(lessons)
    torch.manual_seed(0)
    scene = torch.arange(len(several.optimum)).repeat(2)
    earned, flown = flights(GeneralistNetwork(32, 16), several.world, scene)
    assert (earned <= several.optimum[scene] * (1 + 2e-3)).all()
    assert torch.equal(earned[: len(earned) // 2], earned[len(earned) // 2 :])
    assert len(flown) == int(several.world.scenes.num_slots.max())
