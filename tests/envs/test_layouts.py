"""Layouts that differ within a batch."""

from typing import Any

import numpy as np
import pytest
import torch

from hyuav import Scenario, clusters, disk, make_env
from hyuav.envs.secure_offloading import SecureOffloadingEnv


def test_a_list_of_scenarios_is_a_row_each() -> None:
    layouts = [disk(10, seed=seed) for seed in range(6)]
    env = make_env(layouts, seed=0)
    assert env.batch_size == (6,)
    flights = env.rollout(2)
    for row, layout in enumerate(layouts):
        to_first = torch.tensor(layout[0]) - flights["next", "position"][row, -1, 0]
        assert flights["next", "distances"][row, -1, 0, 0] == pytest.approx(to_first.norm().item())


def test_presets_scenarios_and_positions_may_stand_beside_each_other() -> None:
    drawn = clusters([4, 6], seed=1)
    mixed: list[Any] = ["two_clusters", Scenario(ue_positions=drawn), drawn, np.array(drawn)]
    env = make_env(mixed)
    assert env.batch_size == (4,)
    assert env.base_env.scenarios[0] == Scenario.preset("two_clusters")
    assert len(set(env.base_env.scenarios[1:])) == 1
    assert make_env([*env.base_env.scenarios], batch_size=(4, 2)).batch_size == (4, 2)


@pytest.mark.parametrize("kind", [tuple, list, np.array, torch.tensor])
def test_positions_alone_are_one_layout_of_every_row(kind: Any) -> None:
    drawn = disk(5, seed=2)
    env = SecureOffloadingEnv(kind(drawn), batch_size=3)
    (scenario,) = env.scenarios
    np.testing.assert_allclose(scenario.ue_positions, drawn, rtol=1e-6)
    assert env.batch_size == (3,)
