"""Which rows of a batch share their luck."""

from typing import Any

import pytest
import torch

from hyuav import InputError, Scenario
from hyuav.envs.transforms import make_env
from reference import assert_same

SCENARIO = Scenario.preset("two_clusters")


def flown(seed: Any, batch: tuple[int, ...], **options: Any) -> Any:
    env = make_env(SCENARIO, "hybrid", batch, seed=seed, **options)
    return env.rollout(70, lambda td: td.set("action", torch.zeros(*batch, 2)))["next"]


@pytest.mark.parametrize("diagnostics", [False, True])
def test_a_rows_fading_and_tasks_depend_on_its_own_seed_alone(diagnostics: bool) -> None:
    several = flown([3, 8, 3], (3,), diagnostics=diagnostics)
    alone = flown([8], (1,), diagnostics=diagnostics)
    assert_same(several[1], alone[0])
    assert_same(several[0], several[2])
    assert not torch.equal(several["reward"][0], several["reward"][1])


def test_rows_of_equal_seeds_share_the_luck_of_every_helper_in_them() -> None:
    several = flown([3, 3], (2, 40))
    assert_same(several[0], several[1])
    assert several["reward"][0, :, 0].std() > 0


def test_random_numbers_continue_from_a_saved_state() -> None:
    first, second = (make_env(SCENARIO, batch_size=(2,), seed=[s, 9]) for s in (1, 2))
    first.rollout(30)
    second.base_env.draws.set_state(first.base_env.draws.state())
    assert torch.equal(first.reset()["mode"], second.reset()["mode"])
    assert torch.equal(first.base_env.draws.fading(), second.base_env.draws.fading())
    assert torch.equal(first.base_env.draws.tasks().size, second.base_env.draws.tasks().size)


@pytest.mark.parametrize("seed", [[1], [1, 2, 3], [1, -1]])
def test_seeds_that_do_not_fit_the_rows_are_refused(seed: list[int]) -> None:
    with pytest.raises(InputError, match=r"^seed = [^\n]*: expected"):
        make_env(SCENARIO, batch_size=(2,), seed=seed)
