"""The one line that answers bad input."""

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from hyuav._support.errors import InputError, InputTypeError, rejection, require_choice


def test_bad_input_can_be_caught_as_the_standard_errors() -> None:
    assert issubclass(InputError, ValueError)
    assert issubclass(InputTypeError, InputError)
    assert issubclass(InputTypeError, TypeError)


@given(st.text() | st.binary() | st.lists(st.text()) | st.floats())
def test_a_rejection_is_one_short_line_that_starts_with_the_field(value: object) -> None:
    line = rejection("altitude", value, "a finite number > 0")
    assert line.startswith("altitude = ")
    assert line.endswith(": expected a finite number > 0")
    assert len(line.splitlines()) == 1
    assert len(line) < 130


def test_the_many_lines_of_a_tensor_become_one() -> None:
    line = rejection("task_size", torch.zeros(50, 50), "two numbers")
    assert len(line.splitlines()) == 1
    assert len(line) < 120


@pytest.mark.parametrize("value", ["box", "disc"])
def test_a_choice_is_accepted(value: str) -> None:
    require_choice("speed_limit", value, ("box", "disc"))


@pytest.mark.parametrize(
    "value",
    ["disk", "", "BOX", None, 3, ["box"], b"box", np.array([1.0, 2.0]), np.array(["box", "disc"])],
)
def test_anything_else_is_answered_with_the_choices(value: object) -> None:
    with pytest.raises(InputError, match=r"^speed_limit = .*: expected one of box, disc"):
        require_choice("speed_limit", value, ("box", "disc"))


def test_a_misspelt_choice_is_answered_with_the_closest() -> None:
    with pytest.raises(InputError, match=r"did you mean 'jamming'\?"):
        require_choice("scheme", "jaming", ("hybrid", "relay", "jamming"))


def test_nonsense_is_answered_without_a_guess() -> None:
    with pytest.raises(InputError) as caught:
        require_choice("scheme", "qqqqqq", ("hybrid", "relay", "jamming"))
    assert "did you mean" not in str(caught.value)
