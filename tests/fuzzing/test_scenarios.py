"""Hostile scenarios: refused in one line, or flown with finite results."""

import dataclasses
from typing import Any

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from hostile import CASES, TRIED, anything, attempt, damaged, fuzz, numbers, texts
from hyuav import InputError, Scenario, make_env

PRESET = Scenario.preset("two_clusters")
BOUNDS: dict[str, tuple[float, float]] = {
    **dict.fromkeys(("map_side", "altitude", "eavesdropper_altitude"), (1e-6, 1e9)),
    **dict.fromkeys(("slot_duration", "max_speed", "helper_mass"), (1e-9, 1e9)),
    **dict.fromkeys(("off_map_penalty", "min_secrecy_rate", "coverage_radius"), (0.0, 1e9)),
    **dict.fromkeys(("ue_power", "jamming_power", "relay_power"), (0.0, 1e6)),
    **dict.fromkeys(("ground_to_air_gain", "air_to_air_gain"), (0.0, 1e6)),
    **dict.fromkeys(("ground_to_air_k_factor", "air_to_air_k_factor"), (-100.0, 100.0)),
    **dict.fromkeys(
        ("ue_energy_budget", "edge_energy_budget", "helper_energy_budget"), (0.0, 1e30)
    ),
    "noise_power": (1e-24, 1e6),
    "capacitance": (0.0, 1.0),
}
"""The ends of what each parameter may be."""


def fly(scenario: Scenario) -> None:
    """Three slots of four helpers under every scheme; all that is a number is finite."""
    env = make_env(
        dataclasses.replace(scenario, num_slots=3),
        ["hybrid", "relay", "jamming"],
        (3,),
        seed=0,
        diagnostics=True,
        clock=True,
        geofence=scenario.speed_limit == "disc",
    )
    actions = torch.tensor([[1.0, -1.0], [0.5, 1.0], [0.0, 0.0]])
    state = env.reset()
    for slot in range(3):
        flown = env.step(state.set("action", actions.roll(slot, 0)))["next"]
        for name, values in flown.items(include_nested=True, leaves_only=True):
            assert values.isfinite().all(), name
        assert (flown["position"].abs() <= scenario.map_side / 2 * (1 + 1e-6)).all()
        state = env.step_mdp(flown.empty().set("next", flown))


fields = damaged(
    {name: value for name, value in PRESET.to_dict().items() if name != "ue_positions"}
) | st.dictionaries(st.sampled_from(sorted(BOUNDS)), numbers, max_size=4)
positions = st.just([[1.0, 2.0], [-3.0, 4.0]]) | st.lists(
    st.tuples(numbers, numbers) | anything, max_size=4
)


@pytest.mark.slow
def test_a_hostile_scenario_is_refused_or_flown() -> None:
    kind = "scenario"

    @fuzz(kind)
    @given(fields, positions)
    def try_one(values: dict[str, Any], ues: Any) -> None:
        whole = values if "ue_positions" in values else {**values, "ue_positions": ues}
        scenario = attempt(kind, lambda: Scenario.from_dict(whole))
        if scenario is not None and scenario.num_ues <= 1000:
            fly(scenario)

    try_one()
    assert sum(TRIED[kind, outcome] for outcome in ("worked", "refused")) >= CASES[kind]


@st.composite
def extremes(draw: st.DrawFn) -> dict[str, Any]:
    """Parameters at the ends of what is accepted, or anywhere between."""
    names = draw(st.lists(st.sampled_from(sorted(BOUNDS)), unique=True, min_size=1))
    values: dict[str, Any] = {
        name: draw(st.sampled_from(BOUNDS[name]) | st.floats(*BOUNDS[name])) for name in names
    }
    half = values.get("map_side", PRESET.map_side) / 2
    corner = st.sampled_from([-half, 0.0, half])
    point = st.tuples(corner, corner)
    values["ue_positions"] = draw(st.lists(point, min_size=1, max_size=4))
    for name in ("legitimate_position", "eavesdropper_positions", "helper_starts"):
        values[name] = draw(point)
    for name in ("task_size", "cycles_per_bit"):
        values[name] = draw(st.sampled_from([(0.0, 0.0), (0.0, 1e12), (1e6, 1e6)]))
    values["fading"] = draw(st.booleans())
    values["speed_limit"] = draw(st.sampled_from(["box", "disc"]))
    return values


@pytest.mark.slow
def test_an_extreme_scenario_stays_finite() -> None:
    kind = "extreme scenario"

    @fuzz(kind)
    @given(extremes())
    def try_one(values: dict[str, Any]) -> None:
        scenario = attempt(kind, lambda: Scenario.from_dict(values))
        if scenario is not None:
            fly(scenario)

    try_one()
    assert TRIED[kind, "worked"] > CASES[kind] / 4


@pytest.mark.parametrize("name", sorted(BOUNDS))
def test_the_ends_of_what_a_parameter_may_be_are_flown(name: str) -> None:
    origin = dict.fromkeys(
        ("legitimate_position", "eavesdropper_positions", "helper_starts"), (0.0, 0.0)
    )
    for value in BOUNDS[name]:
        changes: dict[str, Any] = {**origin, "ue_positions": [(0.0, 0.0)] * 2, name: value}
        fly(dataclasses.replace(PRESET, **changes))


@given(texts)
def test_no_name_is_a_preset_by_accident(name: str) -> None:
    with pytest.raises(InputError):
        Scenario.preset(name)
