"""Which rows of a batch share their luck."""

import dataclasses
from typing import Any

import pytest
import torch
from scipy import stats

from hyuav import InputError, Scenario
from hyuav._support.randomness import GAMMA, splitmix64
from hyuav.envs.draws import Draws
from hyuav.envs.transforms import make_env
from hyuav.physics.slot import Physics
from reference import assert_same

SCENARIO = Scenario.preset("two_clusters")


SIMPLE = dataclasses.replace(SCENARIO, ground_to_air_k_factor=3.0, air_to_air_k_factor=9.0)


def drawn(seed: int = 0, batch: tuple[int, ...] = (50_000,)) -> torch.Tensor:
    fading = Draws(Physics(SIMPLE), torch.Size(batch), seed).fading()
    assert fading is not None
    return fading


def test_the_random_bits_are_those_of_splitmix64() -> None:
    states = 1234567 + GAMMA * torch.arange(1, 6)
    assert [bits % 2**64 for bits in splitmix64(states).tolist()] == [
        6457827717110365317,
        3203168211198807973,
        9817491932198370423,
        4593380528125082431,
        16408922859458223821,
    ]


@pytest.mark.parametrize(
    ("link", "decibel"), [(0, 3.0), (17, 3.0), (29, 3.0), (30, 9.0), (31, 9.0)]
)
def test_the_fading_of_every_link_follows_the_law_of_its_definition(
    link: int, decibel: float
) -> None:
    k_factor = 10 ** (decibel / 10)
    # |gamma|^2 is a noncentral chi-squared variable of two degrees, in units of 1 / (2 (K + 1)).
    law = stats.ncx2(2, 2 * k_factor, scale=0.5 / (k_factor + 1))
    powers = drawn()[:, link].double().numpy()
    assert stats.kstest(powers, law.cdf).pvalue > 1e-3
    assert powers.mean() == pytest.approx(1.0, abs=0.02)
    assert powers.var() == pytest.approx(law.var(), rel=0.05)


def test_links_helpers_and_slots_are_drawn_independently() -> None:
    draws = Draws(Physics(SIMPLE), torch.Size((20_000, 2)), 3)
    powers = draws.take_fading(2)
    assert powers is not None
    correlation = torch.corrcoef(powers.permute(0, 2, 3, 1).flatten(0, 2)).fill_diagonal_(0.0)
    assert float(correlation.abs().max()) < 0.04


def test_other_seeds_bring_other_numbers() -> None:
    first, second = drawn(1).flatten(), drawn(2).flatten()
    assert float(torch.corrcoef(torch.stack([first, second]))[0, 1]) == pytest.approx(0, abs=0.005)


def test_the_levels_of_the_tasks_are_uniform_and_independent_of_the_fading() -> None:
    draws = Draws(Physics(SIMPLE), torch.Size((50_000,)), 0)
    tasks, fading = draws.tasks(), draws.fading()
    low, high = SIMPLE.task_size
    level = (tasks.size[:, 3].double() - low) / (high - low)
    assert stats.kstest(level.numpy(), "uniform").pvalue > 1e-3
    assert fading is not None
    both = torch.stack([fading[:, 3], tasks.size[:, 3]])
    assert float(torch.corrcoef(both)[0, 1]) == pytest.approx(0.0, abs=0.02)


@pytest.mark.parametrize("seed", [4, [4, 7, 4]])
def test_it_does_not_matter_how_many_numbers_are_drawn_at_once(seed: Any) -> None:
    one, several = (make_env(SCENARIO, batch_size=(3, 2), seed=seed).base_env.draws for _ in "ab")
    blocks = [several.take_fading(count) for count in (1, 300, 19)]
    assert torch.equal(torch.stack([one.fading() for _ in range(320)]), torch.cat(blocks))
    tasks = torch.stack([torch.stack(one.tasks(), dim=1) for _ in range(5)])
    assert torch.equal(tasks, several.take_tasks(5))


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
