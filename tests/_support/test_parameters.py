"""Records of parameters: what their fields accept, plain values, and files."""

import dataclasses
import math
import re
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pytest
import torch
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pydantic import Field
from pydantic.dataclasses import dataclass

import worlds
from hyuav import InputError, InputTypeError, Scenario
from hyuav._support.parameters import (
    Count,
    NonNegativeNumber,
    Number,
    OneOf,
    OneOrMore,
    Parameters,
    PositiveNumber,
    Text,
    ZeroOrMore,
    checked,
    parameter,
)

TWO_CLUSTERS = Scenario.preset("two_clusters")
FIELDS = tuple(field.name for field in dataclasses.fields(Scenario))
BUDGETS = ("ue_energy_budget", "edge_energy_budget", "helper_energy_budget")


def refused(annotation: Any, value: Any, accepted: str, error: type[Exception]) -> None:
    """A field of such a type answers ``value`` in one line with just this error."""
    with pytest.raises(
        InputError, match=rf"^field = .*: expected {re.escape(accepted)}$"
    ) as caught:
        checked(annotation, "field", value)
    assert caught.type is error
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("annotation", "inside", "outside", "accepted"),
    [
        (Number, [-1e300, 0, 1e300], [math.nan, math.inf, -math.inf], "a finite number"),
        (
            Annotated[float, Field(ge=2.0)],
            *([2, 1e300], [1.999, -3, math.inf], "a finite number >= 2"),
        ),
        (PositiveNumber, [5e-324, 7], [0.0, -0.0, -1, math.inf], "a finite number > 0"),
        (
            Annotated[float, Field(ge=-1.0, le=3.0)],
            *([-1, 0.5, 3], [-1.001, 3.001, math.nan], "a number in [-1, 3]"),
        ),
    ],
)
def test_a_number_lies_within_its_bounds(
    annotation: Any, inside: list[float], outside: list[float], accepted: str
) -> None:
    for value in inside:
        assert checked(annotation, "field", value) == value
        assert type(checked(annotation, "field", value)) is float
    for value in outside:
        refused(annotation, value, accepted, InputError)


@pytest.mark.parametrize(
    "value",
    [
        *(1j, 1 + 0j, np.complex64(1), np.complex128(1j), np.array(1j), torch.tensor(1j)),
        *(True, False, np.True_, np.False_, "1", b"1", None, [1.0], 10**400),
        *(np.array([1.0]), torch.ones(1, 1), torch.empty((), device="meta"), {}, object()),
    ],
)
def test_complex_numbers_truth_values_and_text_are_no_numbers(value: Any) -> None:
    refused(Number, value, "a finite number", InputTypeError)


@pytest.mark.parametrize("low", [-3, 0, 1, 7])
def test_a_count_starts_where_it_is_told(low: int) -> None:
    annotation = Annotated[int, Field(ge=low)]
    for value in (low, low + 1, np.int64(low), torch.tensor(low)):
        assert checked(annotation, "field", value) == int(value)
        assert type(checked(annotation, "field", value)) is int
    refused(annotation, low - 1, f"a whole number >= {low}", InputError)
    for other in (float(low), True, np.True_, 1j, str(low), None):
        refused(annotation, other, f"a whole number >= {low}", InputTypeError)


@pytest.mark.parametrize("digits", [16, 400, 5000])
def test_a_count_fits_what_counts_it(digits: int) -> None:
    value = int("f" * digits, 16)  # of the longest, Python writes no decimal digits
    refused(Count, value, f"a whole number <= {2**63 - 1}", InputError)
    refused(Annotated[int, Field(ge=1, le=3)], 4, "a whole number <= 3", InputError)


def test_what_is_optional_may_be_none_and_is_checked_otherwise() -> None:
    assert checked(Count | None, "field", None) is None
    assert checked(Count | None, "field", 3) == 3
    refused(Count | None, 0, "a whole number >= 1", InputError)
    refused(Text | None, 3, "text that is not empty", InputTypeError)


@pytest.mark.parametrize(
    ("value", "kept"),
    [(3, (3,)), ([3], (3,)), ([3, 1], (3, 1)), ((2, 2, 5), (2, 2, 5)), (np.int64(3), (3,))],
)
def test_one_value_or_a_list_of_them_is_kept_as_a_tuple(value: Any, kept: tuple[int, ...]) -> None:
    for annotation in (OneOrMore[Count], ZeroOrMore[Count]):
        assert checked(annotation, "field", value) == kept


def test_of_one_or_more_values_every_one_is_checked() -> None:
    refused(OneOrMore[Count], [], "a list of a whole number >= 1", InputError)
    assert checked(ZeroOrMore[Count], "field", []) == ()
    for annotation in (OneOrMore[Count], ZeroOrMore[Count]):
        refused(annotation, "two", "a whole number >= 1", InputTypeError)
        with pytest.raises(InputError, match=r"^field\[1\] = 0: expected a whole number >= 1$"):
            checked(annotation, "field", [1, 0])


def test_text_is_kept_as_it_is_and_not_empty() -> None:
    for value in (" a b ", "\ud800", "\x1b[2J"):
        assert checked(Text, "field", value) == value
    for empty in ("", "  ", "\n\t"):
        refused(Text, empty, "text that is not empty", InputError)
    for other in (None, 3, b"a", ["a"]):
        refused(Text, other, "text that is not empty", InputTypeError)


def test_a_choice_is_one_of_those_given() -> None:
    shape = Annotated[str, OneOf("box", "disc")]
    assert [checked(shape, "field", name) for name in ("box", "disc")] == ["box", "disc"]
    others: list[Any] = ["polygon", "", None, 3, ["box"], {}]
    for other in others:
        refused(shape, other, "one of box, disc", InputError)
    with pytest.raises(InputError, match=r"one of box, disc \(did you mean 'disc'\?\)$"):
        checked(shape, "field", "disk")


@pytest.mark.parametrize(
    "value", [[1, 2], (1, 2), range(1, 3), np.array([1, 2]), torch.tensor([1.0, 2.0])]
)
def test_a_sequence_of_any_kind_is_kept_as_a_tuple(value: Any) -> None:
    for annotation in (tuple[Number, ...], tuple[Number, Number]):
        kept = checked(annotation, "field", value)
        assert kept == (1.0, 2.0)
        assert [type(item) for item in kept] == [float, float]


def test_a_sequence_has_its_length_and_checks_every_element() -> None:
    pair = Annotated[tuple[NonNegativeNumber, NonNegativeNumber], Field(description="a pair")]
    for items in ([], [1], [1, 2, 3], torch.zeros(0)):
        refused(pair, items, "a pair", InputError)
    for other in (None, 3, "12", {1, 2}, {1: 2}, np.array(3.0)):
        refused(pair, other, "a pair", InputTypeError)
    with pytest.raises(InputError, match=r"^field\[1\] = -1: expected a finite number >= 0$"):
        checked(pair, "field", [0, -1])
    with pytest.raises(InputTypeError, match=r"^field\[1\]\[0\] = 'a': expected a finite number$"):
        checked(tuple[tuple[Number, ...], ...], "field", [[1], ["a"]])


def test_a_list_within_itself_is_refused() -> None:
    endless: list[Any] = []
    endless.append(endless)
    with pytest.raises(InputTypeError, match=r"^field(\[0\])* = .*: expected"):
        checked(tuple[tuple[Number, ...], ...], "field", endless)


@dataclass(frozen=True)
class Engine(Parameters):
    """A record within another."""

    power: PositiveNumber = parameter(2.0)
    gears: tuple[Count, ...] = parameter((1, 2))


@dataclass(frozen=True)
class Vehicle(Parameters):
    """A record with another."""

    engine: Engine = parameter(Engine())
    spare: Engine | None = parameter(None)

    def __post_init__(self) -> None:
        if self.engine.power > 100.0:
            raise InputError("engine.power = too much: expected less")


def test_a_record_within_another_is_made_of_names_with_values() -> None:
    vehicle = Vehicle.from_dict({"engine": {"gears": [3]}, "spare": {"power": 1}})
    assert vehicle == Vehicle(Engine(gears=(3,)), Engine(1.0))
    assert vehicle.to_dict() == {
        "engine": {"power": 2.0, "gears": [3]},
        "spare": {"power": 1.0, "gears": [1, 2]},
    }
    assert Vehicle.from_dict(vehicle.to_dict()) == vehicle
    assert Vehicle.from_dict(Vehicle().to_dict()) == Vehicle()


@pytest.mark.parametrize(
    ("values", "line"),
    [
        ({"engine": {"power": 0}}, "engine.power = 0: expected a finite number > 0"),
        ({"spare": {"gears": [1, 0]}}, "spare.gears[1] = 0: expected a whole number >= 1"),
        ({"engine": {"powr": 1}}, "engine: unknown field 'powr': did you mean 'power'?"),
        ({"engine": 3}, "engine = 3: expected names with values"),
        ({"engine": {"power": 200.0}}, "engine.power = too much: expected less"),
        ({"motor": 3}, "vehicle: unknown field 'motor': one of engine, spare"),
    ],
)
def test_a_field_of_a_record_within_another_is_named(values: dict[str, Any], line: str) -> None:
    with pytest.raises(InputError, match=f"^{re.escape(line)}$"):
        Vehicle.from_dict(values)
    with pytest.raises(InputError, match=f"^{re.escape(line)}$"):
        Vehicle(**values)


def test_what_stands_in_the_place_of_a_field_has_its_name() -> None:
    with pytest.raises(InputError, match=r"^power = -1: expected a finite number > 0$"):
        Engine(-1)
    with pytest.raises(InputTypeError, match=r"^engine: unexpected positional argument: 2$"):
        Engine(1.0, (1,), 3)  # type: ignore[call-arg]


def test_a_record_that_nothing_would_check_is_no_record() -> None:
    @dataclasses.dataclass(frozen=True)
    class Unchecked(Engine):
        seats: Count = parameter(4)

    with pytest.raises(TypeError, match=r"^Unchecked is to be a dataclass of pydantic"):
        Unchecked(seats=0)


@given(worlds.scenarios())
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_scenario_survives_a_file_without_loss(tmp_path: Path, scenario: Scenario) -> None:
    file = tmp_path / "scenario.yaml"
    scenario.save(file)
    assert Scenario.load(file) == scenario
    assert Scenario.load(str(file)) == scenario


@given(
    st.sampled_from(BUDGETS),
    st.floats(0.0, 1e30),
)
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_every_bit_of_a_number_survives_a_file(tmp_path: Path, name: str, value: float) -> None:
    file = tmp_path / "scenario.yaml"
    changes: dict[str, Any] = {name: value}
    dataclasses.replace(TWO_CLUSTERS, **changes).save(file)
    assert getattr(Scenario.load(file), name) == value


@given(worlds.scenarios())
def test_a_scenario_survives_plain_values_without_loss(scenario: Scenario) -> None:
    values = scenario.to_dict()
    assert set(values) == set(FIELDS)
    assert {type(value) for value in values.values()} <= {list, float, int, str, bool}
    assert Scenario.from_dict(values) == scenario


def written(tmp_path: Path, text: str) -> Path:
    file = tmp_path / "scenario.yaml"
    file.write_text(text)
    return file


@pytest.mark.parametrize(
    ("text", "value"),
    [("1e-13", 1e-13), ("2E-12", 2e-12), ("1.5e-13", 1.5e-13), ("1", 1.0), ("+1e+1", 10.0)],
)
def test_a_number_in_a_file_needs_no_point(tmp_path: Path, text: str, value: float) -> None:
    file = written(tmp_path, f"ue_positions: [[1, 2]]\nnoise_power: {text}\n")
    assert Scenario.load(file).noise_power == value


def test_a_file_names_only_what_differs_from_the_defaults(tmp_path: Path) -> None:
    file = written(tmp_path, "ue_positions:\n- [1, 2]\n- [3.5, -4]\nfading: false\nnum_slots: 7\n")
    expected = Scenario(ue_positions=((1.0, 2.0), (3.5, -4.0)), fading=False, num_slots=7)
    assert Scenario.load(file) == expected


@pytest.mark.parametrize(
    "text",
    [
        "",
        "3",
        "just text",
        "[1, 2, 3]",
        "a: b: c",
        "ue_positions: [[1, 2",
        "ue_positions: [[1, 2]]\n\tnum_slots: 3",
        "\x00\x01\x02",
        "num_slots: !!int many\n",
        "num_slots: !!timestamp 2020-99-99\n",
        "ue_positions: &a [*a]\n",
        "ue_positions: !thing 3\n",
        "null: 3\n",
        "? [1, 2]\n: 3\n",
        "num_slots: 3\nnum_slots: 4\n",
        "ue_positions: ${elsewhere}\n",
        "ue_positions: ???\n",
        "num_slots: 5\n",
    ],
)
def test_what_is_no_scenario_is_answered_in_one_line(tmp_path: Path, text: str) -> None:
    with pytest.raises(InputError) as caught:
        Scenario.load(written(tmp_path, text))
    assert len(str(caught.value).splitlines()) == 1


@given(st.text(max_size=60) | st.binary(max_size=60))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=200)
def test_no_file_can_do_worse_than_an_input_error(tmp_path: Path, content: str | bytes) -> None:
    file = tmp_path / "scenario.yaml"
    file.write_bytes(content if isinstance(content, bytes) else content.encode(errors="replace"))
    with pytest.raises(InputError) as caught:
        Scenario.load(file)
    assert len(str(caught.value).splitlines()) == 1


def test_a_truncated_file_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "scenario.yaml"
    TWO_CLUSTERS.save(file)
    whole = file.read_text()
    # Without the end of the last number, or within a name, or within a list.
    for cut in (whole.index("helper_starts") + 6, whole.index("ue_positions") + 3, 0):
        file.write_text(whole[:cut])
        with pytest.raises(InputError):
            Scenario.load(file)


def test_a_missing_file_and_a_folder_are_named(tmp_path: Path) -> None:
    for path in (tmp_path / "none.yaml", tmp_path):
        with pytest.raises(InputError, match="cannot be read") as caught:
            Scenario.load(path)
        assert str(path) in str(caught.value)
        assert len(str(caught.value).splitlines()) == 1


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("num_slots: ten", "num_slots = 'ten': expected a whole number >= 1"),
        ("num_slots: 2.5", "num_slots = 2.5: expected a whole number >= 1"),
        ("altitude: high", "altitude = 'high': expected a number in [1e-06, 1e+09]"),
        ("fading: 1", "fading = 1: expected true or false"),
        ("altitude: .nan", "altitude = nan: expected a number in [1e-06, 1e+09]"),
        ("task_size: 3", "task_size = 3: expected two numbers"),
    ],
)
def test_a_wrong_value_in_a_file_is_named(tmp_path: Path, text: str, message: str) -> None:
    file = written(tmp_path, f"ue_positions: [[1, 2]]\n{text}\n")
    with pytest.raises(
        InputError, match="^" + re.escape(f"scenario file {str(file)!r}: {message}")
    ):
        Scenario.load(file)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (
            "ue_positions: [[1, 2]]\nue_power: -1\n",
            "ue_power = -1: expected a number in [0, 1e+06]",
        ),
        ("ue_positions: [[1, 2]]\nue_powr: 1\n", "scenario: unknown field 'ue_powr'"),
        ("ue_power: 1\n", "scenario: ue_positions is missing"),
        ("[1, 2]\n", "expected fields with values"),
        ("a: b: c\n", "cannot be read ("),
    ],
)
def test_every_error_of_a_file_starts_with_the_file(
    tmp_path: Path, content: str, message: str
) -> None:
    file = written(tmp_path, content)
    with pytest.raises(InputError) as caught:
        Scenario.load(file)
    assert str(caught.value).startswith(f"scenario file {str(file)!r}: {message}")


def test_a_misspelt_field_is_answered_with_the_closest() -> None:
    with pytest.raises(InputError, match=r"^scenario: unknown field 'num_slot'.*'num_slots'\?"):
        Scenario.from_dict({"ue_positions": [[1, 2]], "num_slot": 3})


@pytest.mark.parametrize("name", ["qqqqq", 3, None, ("a", "b")])
def test_an_unknown_field_is_answered_with_those_there_are(name: Any) -> None:
    with pytest.raises(InputError, match="unknown field") as caught:
        Scenario.from_dict({"ue_positions": [[1, 2]], name: 3})
    assert "altitude" in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1


def test_a_scenario_needs_ues() -> None:
    with pytest.raises(InputError, match=r"^scenario: ue_positions is missing$"):
        Scenario.from_dict({"num_slots": 3})


@pytest.mark.parametrize("values", [None, 3, "two_clusters", [1, 2]])
def test_a_record_is_made_of_names_with_values_alone(values: Any) -> None:
    with pytest.raises(InputTypeError, match=r"^scenario = .*: expected names with values$"):
        Scenario.from_dict(values)
