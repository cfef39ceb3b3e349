"""What the generalist knows of a scenario is what the physics says."""

import dataclasses

import numpy as np
import pytest
import torch

from hyuav import Scenario, family
from hyuav.learning.generalist.plans import at_the_end, roughly_best
from hyuav.learning.generalist.scene import (
    CANDIDATES,
    OUTSIDE,
    TURNS,
    VIEWS,
    offsets,
    scenes_of,
    window,
)
from hyuav.physics.slot import Physics
from hyuav.references.rewards import sum_rates

TINY = dataclasses.replace(
    Scenario.preset("two_clusters"),
    fading=False,
    map_side=120.0,
    eavesdropper_positions=((50, 50),),
)


def test_a_map_tells_what_a_slot_brings_at_each_place() -> None:
    scene = scenes_of(TINY, "hybrid")
    physics = Physics(TINY, dtype=torch.float64)
    for row, column in ((30, 30), (12, 55), (60, 0)):
        place = scene.corner[0] + scene.spacing[0] * torch.tensor([row, column])
        both = sum_rates(physics, [(False,), (True,)], place.double().view(1, 2), (1,), None, None)
        told = scene.rewards[0, row * scene.side + column] * scene.best
        assert float(told) == pytest.approx(float(both.max()), rel=1e-4, abs=1e-4)
    assert float(scene.rewards.max()) == pytest.approx(1.0)


def test_a_map_begins_where_the_helper_does() -> None:
    scene = scenes_of(TINY, "relay")
    start = scene.corner[0] + scene.spacing[0] * scene.start[0]
    assert start.tolist() == list(TINY.helper_starts[0])


def test_views_tell_the_best_nearby() -> None:
    scene = scenes_of(TINY, "jamming")
    square = scene.rewards[0, :-1].reshape(scene.side, scene.side).numpy()
    for number, (spacing, _) in enumerate(VIEWS):
        half = (spacing + 1 - spacing % 2) // 2
        own = square[max(20 - half, 0) : 21 + half, max(25 - half, 0) : 26 + half].max()
        told = float(scene.views[0, number, 20 * scene.side + 25])
        assert told == pytest.approx(float(own), abs=1e-3)


def test_beyond_the_edge_a_map_tells_that_it_ends() -> None:
    scene = scenes_of(TINY, "hybrid")
    zero = torch.zeros(1, dtype=torch.int64)
    corner = window(scene.side, torch.tensor([[0, 0]]), 1, 21, TURNS[0].unsqueeze(0))
    told = scene.rewards_at(zero, corner)
    square = told.reshape(21, 21)
    assert (square[:10] == OUTSIDE).all()
    assert (square[:, :10] == OUTSIDE).all()
    assert (square[10:, 10:] > OUTSIDE).all()


def test_a_disc_shaped_limit_is_kept() -> None:
    box, disc = (
        scenes_of(dataclasses.replace(TINY, speed_limit=limit), "hybrid").reachable[0]
        for limit in ("box", "disc")
    )
    assert box.all()
    assert torch.equal(disc, (CANDIDATES.square().sum(dim=-1) <= 100))


def test_the_turns_are_the_symmetries_of_the_square() -> None:
    square = {tuple(place) for place in offsets(3, 5).tolist()}
    several = {tuple((offsets(3, 5) @ turn.T).flatten().tolist()) for turn in TURNS}
    assert len(several) == 8
    for turn in TURNS:
        assert {tuple(place) for place in (offsets(3, 5) @ turn.T).tolist()} == square


def test_several_helpers_see_what_the_others_make_possible() -> None:
    scenario = Scenario.preset("contested")
    alone = scenes_of(scenario, "hybrid", draws=1)
    together = scenes_of(scenario, "hybrid", 1, at_the_end(roughly_best(scenario, "hybrid")))
    assert together.count == alone.count == 2
    assert bool((together.best > alone.best).all())
    assert float(together.best.min()) > 15.0


def test_with_power_a_map_tells_the_level_that_brings_most() -> None:
    scenario = dataclasses.replace(family("one", 2).scenario, power_control=True)
    scene = scenes_of(scenario, "jamming")
    shares = scene.shares[0, :-1]
    levels = np.round(-10.0 * np.log10(shares.numpy()), 3)
    assert set(levels.tolist()) <= {float(level) for level in range(0, 61, 5)}
    fixed = scenes_of(dataclasses.replace(scenario, power_control=False), "jamming")
    assert float(scene.best) >= float(fixed.best)


@pytest.mark.parametrize("turn", TURNS)
def test_a_turned_window_reads_the_map_along_turned_axes(turn: torch.Tensor) -> None:
    index = window(7, torch.tensor([[2, 5]]), 2, 5, turn.unsqueeze(0))
    places = torch.tensor([2, 5]) + offsets(2, 5) @ turn.T
    inside = ((places >= 0) & (places < 7)).all(dim=-1)
    expected = torch.where(inside, places[:, 0] * 7 + places[:, 1], 49)
    assert torch.equal(index[0], expected)
