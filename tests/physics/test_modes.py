"""Which modes there are, which of them a rule allows, and which is taken."""

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from hyuav import InputError
from hyuav.physics.modes import ModeRule, beats, fixed_modes, mode_vectors


def taken(rates: list[float], rule: ModeRule) -> int:
    """The number of the mode that is chosen for sum-rates in the order of the modes."""
    chosen, best = 0, torch.tensor([rates[0]])
    for number, rate in enumerate(rates[1:], start=1):
        better, best = beats(torch.tensor([rate]), best, rule, number)
        chosen = number if better else chosen
    assert best.item() == torch.tensor(rates[chosen])
    return chosen


def test_modes_are_counted_with_the_first_helper_as_the_lowest_digit() -> None:
    assert mode_vectors(1) == ((False,), (True,))
    assert mode_vectors(2) == ((False, False), (True, False), (False, True), (True, True))


def test_relaying_needs_a_strictly_larger_sum_rate() -> None:
    pairs = [(1.0, 2.0), (2.0, 1.0), (1.0, 1.0), (0.0, 0.0)]
    assert [taken(list(pair), ModeRule()) for pair in pairs] == [1, 0, 0, 0]


@given(st.lists(st.integers(0, 3).map(float), min_size=8, max_size=8))
def test_of_equal_modes_the_first_is_taken(rates: list[float]) -> None:
    assert taken(rates, ModeRule()) == rates.index(max(rates))
    assert taken(rates, ModeRule.of(["hybrid"], 3)) == rates.index(max(rates))


@given(st.lists(st.floats(0.0, 3.0), min_size=8, max_size=8), st.integers(0, 7))
def test_a_rule_of_letters_takes_its_own_modes_whatever_they_bring(
    rates: list[float], number: int
) -> None:
    letters = "".join("r" if relays else "j" for relays in mode_vectors(3)[number])
    assert taken(rates, ModeRule.of([letters], 3)) == number


@pytest.mark.parametrize(("name", "number"), [("jamming", 0), ("relay", 3)])
def test_a_rule_of_one_mode_holds_for_all_helpers(name: str, number: int) -> None:
    assert taken([1.0, 5.0, 3.0, 2.0], ModeRule.of([name], 2)) == number


def test_the_letters_of_one_helper_are_the_two_fixed_modes() -> None:
    for letter, name in (("r", "relay"), ("j", "jamming")):
        assert fixed_modes(letter, 1) == fixed_modes(name, 1)


@pytest.mark.parametrize("name", ["r", "rjr", "rx", "", "Hybrid", "RJ"])
def test_modes_that_do_not_fit_the_helpers_are_refused(name: str) -> None:
    with pytest.raises(InputError, match=r"^scheme = .* a letter r or j for each of 2 helpers"):
        fixed_modes(name, 2)
