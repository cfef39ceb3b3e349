"""A scenario's fields: their defaults and their checks."""

import dataclasses
import math
import re
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

import worlds
from hyuav import InputError, InputTypeError, Scenario
from hyuav.physics.scenario import PRESETS

TWO_CLUSTERS = Scenario.preset("two_clusters")

POSITIVE = (
    *("slot_duration", "map_side", "altitude", "eavesdropper_altitude", "max_speed"),
    *("helper_mass", "noise_power"),
)
NON_NEGATIVE = (
    *("coverage_radius", "off_map_penalty", "ue_power", "jamming_power", "relay_power"),
    *("ground_to_air_gain", "air_to_air_gain", "min_secrecy_rate", "capacitance"),
    *("ue_energy_budget", "edge_energy_budget", "helper_energy_budget"),
)
WITHIN_FLOAT32 = {
    **dict.fromkeys(("altitude", "eavesdropper_altitude"), (1e-6, 1e9)),
    **dict.fromkeys(("slot_duration", "max_speed", "helper_mass"), (1e-9, 1e9)),
    **dict.fromkeys(("coverage_radius", "off_map_penalty", "min_secrecy_rate"), (0.0, 1e9)),
    **dict.fromkeys(("ue_power", "jamming_power", "relay_power"), (0.0, 1e6)),
    **dict.fromkeys(("ground_to_air_gain", "air_to_air_gain"), (0.0, 1e6)),
    **dict.fromkeys(
        ("ue_energy_budget", "edge_energy_budget", "helper_energy_budget"), (0.0, 1e30)
    ),
    "noise_power": (1e-24, 1e6),
    "capacitance": (0.0, 1.0),
}
DECIBEL = ("ground_to_air_k_factor", "air_to_air_k_factor")
NUMBERS = (*POSITIVE, *NON_NEGATIVE, *DECIBEL)
NODES = ("eavesdropper_positions", "helper_starts")
POINTS = ("legitimate_position", *NODES)
RANGES = ("task_size", "cycles_per_bit")
FIELDS = tuple(field.name for field in dataclasses.fields(Scenario))

NOT_A_NUMBER: list[Any] = [
    *(None, True, "3", b"3", 1j, 1 + 0j, [1.0], (1.0, 2.0), {}, {"a": 1}, object(), print),
    *(np.array([1.0, 2.0]), torch.zeros(2), np.True_, np.complex64(1), torch.tensor(1j)),
]
NOT_FINITE = [math.nan, math.inf, -math.inf]


def refused(name: str, value: Any, error: type[Exception] = InputError) -> str:
    """The message that answers ``value``: one line that starts with the field's name."""
    with pytest.raises(error) as caught:
        dataclasses.replace(TWO_CLUSTERS, **{name: value})
    message = str(caught.value)
    assert re.match(rf"{name}(\[\d+\])* = ", message), message
    assert len(message.splitlines()) == 1
    assert ": expected " in message
    return message


def with_value(name: str, value: Any) -> Any:
    return getattr(dataclasses.replace(TWO_CLUSTERS, **{name: value}), name)


def test_the_defaults_are_those_of_the_papers_parameter_table() -> None:
    expected = {
        "legitimate_position": (0.0, 0.0),
        "eavesdropper_positions": ((80.0, 80.0),),
        "helper_starts": ((-60.0, -60.0),),
        "num_slots": 20,
        "slot_duration": 1.0,
        "map_side": 200.0,
        "altitude": 80.0,
        "eavesdropper_altitude": 120.0,
        "coverage_radius": 45.0,
        "max_speed": 20.0,
        "off_map_penalty": 0.2,
        "helper_mass": 9.65,
        "fading": True,
        "ue_power": 0.1,
        "jamming_power": 0.08,
        "relay_power": 0.012,
        "noise_power": 1e-13,
        "ground_to_air_gain": 1e-5,
        "air_to_air_gain": 1e-4,
        "ground_to_air_k_factor": 12.0,
        "air_to_air_k_factor": 20.0,
        "min_secrecy_rate": 0.1,
        "task_size": (160e3, 240e3),
        "cycles_per_bit": (1000.0, 1200.0),
        "capacitance": 1e-27,
        "ue_energy_budget": 0.025,
        "edge_energy_budget": 24.0,
        "helper_energy_budget": 3900.0,
        "speed_limit": "box",
    }
    assert {name: getattr(TWO_CLUSTERS, name) for name in expected} == expected


def test_the_presets_place_ten_ues() -> None:
    assert PRESETS["random_disk"].ue_positions == (
        *((23, 13), (2, 30), (9, -26), (-28, -16), (30, 20)),
        *((-37, 17), (-22, 3), (18, 29), (-3, -35), (17, 15)),
    )
    assert PRESETS["two_clusters"].ue_positions == (
        *((-10, 18), (-20, 18), (-26, 29), (-25, 26), (-19, 15), (-32, 12), (-35, 20)),
        *((26, -16), (18, -30), (23, -20)),
    )
    for name in PRESETS:
        assert Scenario.preset(name) == PRESETS[name]
        assert Scenario.preset(name).num_ues == 10


def test_the_papers_presets_differ_in_their_ues_alone() -> None:
    ues = Scenario.preset("random_disk").ue_positions
    assert dataclasses.replace(TWO_CLUSTERS, ue_positions=ues) == Scenario.preset("random_disk")


def test_two_eavesdroppers_are_over_the_two_clusters() -> None:
    assert Scenario.preset("two_eavesdroppers") == dataclasses.replace(
        TWO_CLUSTERS,
        eavesdropper_positions=((80, 80), (-80, 60)),
        helper_starts=((-60, -60), (60, -60)),
    )


def test_the_contested_preset_is_the_papers_but_for_its_nodes_coverage_and_jamming() -> None:
    assert Scenario.preset("contested") == Scenario(
        ue_positions=(
            *((-80, -40), (-70, -55), (-60, -70), (-85, -60), (-65, -45)),
            *((70, 60), (60, 75), (80, 50), (75, 70), (55, 60)),
        ),
        legitimate_position=(0, 0),
        eavesdropper_positions=((-60, -50), (60, 55)),
        eavesdropper_altitude=100.0,
        helper_starts=((0, 0), (0, 0)),
        coverage_radius=120.0,
        jamming_power=1e-4,
    )


def test_an_unknown_preset_is_answered_with_the_closest() -> None:
    with pytest.raises(InputError, match=r"^scenario = 'random_disc'.*did you mean 'random_disk'"):
        Scenario.preset("random_disc")


def test_every_parameter_of_the_paper_has_its_symbol_and_unit() -> None:
    metadata = {field.name: field.metadata for field in dataclasses.fields(Scenario)}
    # This project's switches have no symbol in the paper.
    own = {"fading", "speed_limit", "eavesdroppers", "power_control"}
    assert {name for name in FIELDS if not metadata[name]["symbol"]} == own
    symbols = [metadata[name]["symbol"] for name in FIELDS if name not in own]
    assert len(set(symbols)) == len(symbols)
    assert metadata["noise_power"]["unit"] == "W"
    assert metadata["ground_to_air_k_factor"]["unit"] == "dB"


@given(st.sampled_from(FIELDS), st.sampled_from([*NOT_FINITE, None, object(), {}, 1j, b""]))
def test_no_field_takes_what_is_no_value(name: str, value: Any) -> None:
    refused(name, value)


@given(st.sampled_from(NUMBERS), st.sampled_from(NOT_A_NUMBER))
def test_a_number_is_not_taken_from_another_type(name: str, value: Any) -> None:
    refused(name, value, InputTypeError)


@given(
    st.sampled_from(NUMBERS), st.text() | st.binary() | st.lists(st.floats()) | st.complex_numbers()
)
def test_no_text_or_list_is_a_number(name: str, value: Any) -> None:
    refused(name, value, InputTypeError)


@given(st.sampled_from(NUMBERS), st.sampled_from(NOT_FINITE))
def test_a_number_is_finite(name: str, value: float) -> None:
    refused(name, value)


@given(
    st.sampled_from((*POSITIVE, *NON_NEGATIVE)),
    st.floats(max_value=0.0, exclude_max=True, allow_infinity=False),
)
def test_no_length_power_or_energy_is_negative(name: str, value: float) -> None:
    refused(name, value)


@pytest.mark.parametrize("name", POSITIVE)
def test_what_the_equations_divide_by_is_not_zero(name: str) -> None:
    assert "expected a number in [1e-" in refused(name, 0.0)


@pytest.mark.parametrize("name", NON_NEGATIVE)
def test_what_may_vanish_may_be_zero(name: str) -> None:
    assert with_value(name, 0) == 0.0


@given(st.sampled_from(DECIBEL), st.floats(-100.0, 100.0))
def test_a_k_factor_in_decibel_has_either_sign(name: str, value: float) -> None:
    assert with_value(name, value) == value


@given(st.sampled_from(DECIBEL), st.floats(100.1, 1e300), st.sampled_from([-1, 1]))
def test_a_k_factor_beyond_any_power_ratio_is_refused(name: str, size: float, sign: int) -> None:
    refused(name, sign * size)


@pytest.mark.parametrize("name", sorted(WITHIN_FLOAT32))
def test_what_follows_from_a_number_stays_within_float32(name: str) -> None:
    low, high = WITHIN_FLOAT32[name]
    assert with_value(name, low) == low
    assert with_value(name, high) == high
    for beyond in (high * 1.01, low * 0.99 if low else -1e-9):
        assert "expected a number in [" in refused(name, beyond)


@given(
    st.sampled_from([name for name in (*POSITIVE, *NON_NEGATIVE) if name != "map_side"]),
    st.floats(1e-30, 1e30),
)
def test_numbers_are_kept_as_they_are(name: str, value: float) -> None:
    low, high = WITHIN_FLOAT32.get(name, (0.0, math.inf))
    value = min(max(value, low), high)
    for number in (value, np.float64(value), torch.tensor(value, dtype=torch.float64)):
        kept = with_value(name, number)
        assert kept == value
        assert type(kept) is float


@given(st.integers(1, 10**6))
def test_slots_are_counted_in_whole_numbers(count: int) -> None:
    for number in (count, np.int64(count), torch.tensor(count)):
        assert with_value("num_slots", number) == count
        assert type(with_value("num_slots", number)) is int


def test_tasks_whose_energy_no_float32_holds_are_refused() -> None:
    changes: dict[str, Any] = {"task_size": (0, 1e12), "cycles_per_bit": (0, 1e12)}
    with pytest.raises(InputError, match=r"^capacitance = 1\.0: expected tasks of all UEs"):
        dataclasses.replace(TWO_CLUSTERS, capacitance=1, **changes)


@pytest.mark.parametrize("value", [0, -1, -(10**30), 10**6 + 1, 10**12, 10**400])
def test_there_is_a_number_of_slots_that_can_be_flown(value: int) -> None:
    refused("num_slots", value)


@pytest.mark.parametrize(
    "value",
    [*NOT_A_NUMBER, 20.0, 2.5, math.nan, np.float64(3), np.array([3, 4]), torch.tensor(2.5)],
)
def test_slots_are_not_counted_in_anything_else(value: Any) -> None:
    refused("num_slots", value, InputTypeError)


@pytest.mark.parametrize("value", [0, 1, "true", "off", None, [True], np.array([True, False])])
def test_fading_is_on_or_off(value: Any) -> None:
    assert with_value("fading", False) is False
    assert "true or false" in refused("fading", value, InputTypeError)


@pytest.mark.parametrize("value", ["disk", "", None, 1, ["box"], np.array([1.0, 2.0])])
def test_the_speed_limit_is_a_box_or_a_disc(value: Any) -> None:
    assert with_value("speed_limit", "disc") == "disc"
    assert "box, disc" in refused("speed_limit", value)


@pytest.mark.parametrize("name", POINTS)
@pytest.mark.parametrize("value", [(1.0, -2.0), [1, -2], np.array([1, -2]), torch.tensor([1, -2])])
def test_a_position_may_be_a_list_an_array_or_a_tensor(name: str, value: Any) -> None:
    kept = with_value(name, value)
    if name in NODES:  # a pair is taken as one node
        (kept,) = kept
        assert with_value(name, [value]) == (kept,)
    assert kept == (1.0, -2.0)
    assert [type(coordinate) for coordinate in kept] == [float, float]


@pytest.mark.parametrize("name", POINTS)
@pytest.mark.parametrize("value", [(), (1.0,), (1.0, 2.0, 3.0), [math.nan, 0], [0, math.inf]])
def test_a_position_has_two_finite_coordinates(name: str, value: Any) -> None:
    refused(name, value)


@pytest.mark.parametrize("name", POINTS)
@pytest.mark.parametrize("value", [None, 3.0, "xy", {1.0, 2.0}, {"x": 1, "y": 2}, ["a", 1]])
def test_a_position_is_made_of_numbers(name: str, value: Any) -> None:
    refused(name, value, InputTypeError)


@pytest.mark.parametrize("name", POINTS)
@given(axis=st.integers(0, 1), beyond=st.floats(100.001, 1e30), sign=st.sampled_from([-1, 1]))
def test_every_node_lies_on_the_map(name: str, axis: int, beyond: float, sign: int) -> None:
    point = [0.0, 0.0]
    point[axis] = sign * beyond
    assert "on the map" in refused(name, point)
    ues = [(0.0, 0.0), (1.0, 1.0), tuple(point)]
    assert refused("ue_positions", ues).startswith("ue_positions[2] = ")


@pytest.mark.parametrize("name", NODES)
@pytest.mark.parametrize("value", [[(1, 2), (3, 4)], np.zeros((2, 2)), torch.zeros(3, 2)])
def test_there_may_be_several_helpers_and_eavesdroppers(name: str, value: Any) -> None:
    nodes = getattr(dataclasses.replace(TWO_CLUSTERS, **{name: value}), name)
    assert nodes == tuple((float(x), float(y)) for x, y in value)


@pytest.mark.parametrize("name", NODES)
@pytest.mark.parametrize("value", [[], (1.0, 2.0, 3.0), [1.0, 2.0, 3.0], [(1.0, 2.0), 3.0]])
def test_several_nodes_are_pairs_of_coordinates(name: str, value: Any) -> None:
    refused(name, value)


def test_there_are_at_most_six_helpers() -> None:
    assert refused("helper_starts", [(0, 0)] * 7).endswith("of 1 to 6 helpers")


@pytest.mark.parametrize("old", ["helper_start", "eavesdropper_position"])
def test_a_former_name_is_answered_by_the_present_one(old: str) -> None:
    with pytest.raises(InputError, match=f"unknown field '{old}': did you mean '{old}s'"):
        Scenario.from_dict({**TWO_CLUSTERS.to_dict(), old: (0.0, 0.0)})


def test_the_edge_of_the_map_belongs_to_it() -> None:
    assert with_value("helper_starts", [(-100, 100)]) == ((-100.0, 100.0),)
    assert with_value("ue_positions", [(100, -100)]) == ((100.0, -100.0),)


def test_a_map_too_small_for_its_nodes_is_refused() -> None:
    with pytest.raises(InputError, match=r"^eavesdropper_positions\[0\] = .*on the map"):
        dataclasses.replace(TWO_CLUSTERS, map_side=150.0)


@pytest.mark.parametrize(
    "value", [[(1, 2)], [[1, 2], (3, 4)], np.ones((3, 2)), torch.ones(20, 2), ((1, 2),) * 1000]
)
def test_any_number_of_ues_may_be_placed(value: Any) -> None:
    kept = with_value("ue_positions", value)
    assert len(kept) == len(value)
    assert kept[0] == tuple(float(c) for c in value[0])


@pytest.mark.parametrize(
    ("value", "error"),
    [
        ([], InputError),
        (torch.zeros(0, 2), InputError),
        ([(1, 2), (3,)], InputError),
        ([(1, 2, 3)], InputError),
        ([(1, 2), (3, math.nan)], InputError),
        ((1.0, 2.0), InputTypeError),
        ([None], InputTypeError),
        ("random_disk", InputTypeError),
        ({"a": (1, 2)}, InputTypeError),
        ([("a", "b")], InputTypeError),
        (5, InputTypeError),
    ],
)
def test_ue_positions_are_pairs_of_numbers(value: Any, error: type[Exception]) -> None:
    refused("ue_positions", value, error)


@pytest.mark.parametrize("name", RANGES)
@given(low=st.floats(0.0, 1e9), width=st.floats(0.0, 1e9))
def test_a_range_is_two_ordered_numbers(name: str, low: float, width: float) -> None:
    assert with_value(name, [low, low + width]) == (low, low + width)
    if width > 1.0:
        assert "low <= high" in refused(name, [low + width, low])
        refused(name, [-width, low])


@pytest.mark.parametrize("name", RANGES)
@pytest.mark.parametrize(
    "value", [3.0, None, (), (1.0,), (1, 2, 3), "12", ("1", "2"), (1.0, math.inf), (math.nan, 1.0)]
)
def test_a_range_is_nothing_else(name: str, value: Any) -> None:
    refused(name, value)


@pytest.mark.parametrize("name", FIELDS)
def test_a_scenario_is_immutable(name: str) -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        setattr(TWO_CLUSTERS, name, getattr(TWO_CLUSTERS, name))


def test_changing_the_given_list_does_not_change_the_scenario() -> None:
    positions: Any = [[1.0, 2.0], [3.0, 4.0]]
    scenario = Scenario(ue_positions=positions)
    positions[0][0] = 99.0
    assert scenario.ue_positions == ((1.0, 2.0), (3.0, 4.0))


@given(worlds.scenarios())
def test_equal_scenarios_are_one_key(scenario: Scenario) -> None:
    copy = dataclasses.replace(scenario)
    other = dataclasses.replace(scenario, num_slots=scenario.num_slots + 1)
    assert copy is not scenario
    assert {scenario: "first", copy: "second"} == {scenario: "second"}
    assert scenario != other
    assert len({scenario, copy, other}) == 2


def test_a_replaced_value_is_checked_and_the_rest_is_kept() -> None:
    changed = dataclasses.replace(TWO_CLUSTERS, num_slots=10, altitude=60)
    assert (changed.num_slots, changed.altitude) == (10, 60.0)
    assert dataclasses.replace(changed, num_slots=20, altitude=80) == TWO_CLUSTERS
    with pytest.raises(InputError, match=r"^altitude"):
        dataclasses.replace(TWO_CLUSTERS, altitude=-60)
