from typing import Any

import pytest
import torch
from scipy import stats

from hyuav._support.randomness import (
    BLOCK,
    RowStream,
    derived_seed,
    given_normals,
    splitmix64,
    standard_normal,
    uniform,
)

CPU = torch.device("cpu")


def stream(*seeds: int, purpose: str = "noise") -> RowStream:
    return RowStream(standard_normal, (3,), seeds, purpose, CPU)


def test_a_rows_numbers_do_not_depend_on_the_other_rows() -> None:
    alone, among = stream(5), stream(1, 5, 2)
    for _ in range(BLOCK + 2):
        assert torch.equal(next(alone)[0], next(among)[1])


def test_rows_of_equal_seeds_are_equal_and_others_are_not() -> None:
    draws = next(stream(4, 7, 4))
    assert draws.shape == (3, 3)
    assert torch.equal(draws[0], draws[2])
    assert not torch.equal(draws[0], draws[1])
    assert torch.equal(next(stream(4, 4))[0], draws[0])


def test_purposes_are_independent() -> None:
    assert not torch.equal(next(stream(4)), next(stream(4, purpose="fading")))
    assert len({derived_seed(seed, name) for seed in range(50) for name in ("a", "b")}) == 100


@pytest.mark.parametrize("count", [1, BLOCK, 2 * BLOCK + 5])
def test_many_draws_at_once_are_those_one_by_one(count: int) -> None:
    at_once, singly = stream(4, 9), stream(4, 9)
    for each in (at_once, singly):
        next(each)
    assert torch.equal(at_once.take(count), torch.stack([next(singly) for _ in range(count)]))
    assert torch.equal(next(at_once), next(singly))


def test_a_stream_continues_from_its_state() -> None:
    whole, other = stream(4, 9), stream(5, 6)
    whole.take(BLOCK + 7)
    other.set_state(whole.state())
    assert torch.equal(whole.take(BLOCK), other.take(BLOCK))
    with pytest.raises(RuntimeError):
        stream(1).set_state(whole.state())


@pytest.mark.parametrize(
    ("law", "cumulative"), [(uniform, stats.uniform.cdf), (standard_normal, stats.norm.cdf)]
)
def test_numbers_follow_their_law_and_not_each_other(law: Any, cumulative: Any) -> None:
    numbers = RowStream(law, (5, 2), range(40), "law", CPU).take(100)
    assert numbers.shape == (100, 40, 5, 2)
    assert stats.kstest(numbers.flatten().numpy(), cumulative).pvalue > 1e-3
    columns = numbers.movedim(0, -1).reshape(400, 100).double()
    correlation = torch.corrcoef(columns).fill_diagonal_(0.0)
    assert correlation.abs().max() < 6 / 100**0.5
    assert correlation.square().mean() == pytest.approx(1 / 100, rel=0.1)
    assert law(splitmix64(torch.arange(10**6))).isfinite().all()


def test_uniform_numbers_stay_below_one() -> None:
    extremes = uniform(torch.tensor([0, -1, 2**63 - 1, -(2**63)]))
    assert extremes.min() == 0.0
    assert extremes.max() < 1.0


def test_normal_draws_of_pytorch_take_the_given_numbers() -> None:
    given = list(torch.randn(4, 2, 3))
    with given_normals(iter(given)):
        like = torch.randn_like(torch.empty(2, 3))
        reparametrized = torch.distributions.Normal(torch.full((2, 3), 5.0), 2.0).rsample()
        sampled = torch.distributions.Normal(torch.full((2, 3), 5.0), 2.0).sample()
        filled = torch.empty(2, 3).normal_()
        with pytest.raises(RuntimeError, match="rand would draw from the global generator"):
            torch.rand(3)
    for drawn, expected in (
        (like, given[0]),
        (reparametrized, 5 + 2 * given[1]),
        (sampled, 5 + 2 * given[2]),
        (filled, given[3]),
    ):
        torch.testing.assert_close(drawn, expected)
    torch.manual_seed(0)
    assert not torch.equal(torch.randn_like(given[0]), given[0])
