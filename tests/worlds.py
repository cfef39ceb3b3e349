"""Random worlds, for what must hold in any of them."""

import math
from typing import Any

from hypothesis import strategies as st

from hyuav import Scenario


def _decades(low: float, high: float) -> st.SearchStrategy[float]:
    exponents = st.floats(math.log10(low), math.log10(high))
    return exponents.map(lambda exponent: float(10.0**exponent))


def coordinates(half: float) -> st.SearchStrategy[tuple[float, float]]:
    """A point of the map, in steps that both precisions represent exactly."""
    axis = st.integers(-64, 64).map(lambda step: step / 64 * half)
    return st.tuples(axis, axis)


@st.composite
def scenarios(draw: st.DrawFn, fading: bool | None = None, several: bool = False) -> Scenario:
    """Random worlds around the paper's, from easy to hopeless, budgets slack and tight.

    ``several`` is for worlds of 1 to 4 helpers and 1 to 4 eavesdroppers.
    """
    map_side = draw(st.sampled_from([64.0, 200.0, 512.0, 2000.0]))
    # Mostly around the legitimate UAV, otherwise hardly anybody would be covered.
    legitimate = draw(coordinates(map_side / 4))
    near = coordinates(draw(st.sampled_from([8.0, 32.0, map_side / 4])))
    offsets = draw(st.lists(near, min_size=1, max_size=20))
    half = map_side / 2
    ues = [
        tuple(min(max(c + o, -half), half) for c, o in zip(legitimate, offset, strict=True))
        for offset in offsets
    ]
    nodes = st.lists(coordinates(half), min_size=1, max_size=4 if several else 1)
    altitude = draw(st.floats(5.0, 300.0))
    above = draw(st.sampled_from([-1.0, 1.0])) * draw(st.floats(2.0, 100.0))
    largest_task = [draw(_decades(1e3, 1e6)) for _ in range(2)]
    tasks = [(high * draw(st.floats(0.0, 1.0)), high) for high in largest_task]
    ue_power, slot_duration = draw(_decades(1e-3, 1.0)), draw(st.floats(0.25, 4.0))
    values: dict[str, Any] = {
        "ue_positions": ues,
        "legitimate_position": legitimate,
        "eavesdropper_positions": draw(nodes),
        "helper_starts": draw(nodes),
        "eavesdroppers": draw(st.sampled_from(["independent", "colluding"])),
        "num_slots": draw(st.integers(1, 50)),
        "slot_duration": slot_duration,
        "map_side": map_side,
        "altitude": altitude,
        "eavesdropper_altitude": altitude + above if altitude + above > 1.0 else altitude - above,
        "coverage_radius": draw(st.floats(5.0, map_side)),
        "max_speed": draw(st.floats(1.0, 100.0)),
        "speed_limit": draw(st.sampled_from(["box", "disc"])),
        "off_map_penalty": draw(st.floats(0.0, 2.0)),
        "helper_mass": draw(st.floats(0.5, 50.0)),
        "ue_power": ue_power,
        "jamming_power": draw(st.just(0.0) | _decades(1e-4, 10.0)),
        "relay_power": draw(st.just(0.0) | _decades(1e-4, 0.1)),
        "noise_power": draw(_decades(1e-15, 1e-10)),
        "ground_to_air_gain": draw(_decades(1e-6, 1e-3)),
        "air_to_air_gain": draw(_decades(1e-6, 1e-3)),
        "ground_to_air_k_factor": draw(st.floats(-20.0, 40.0)),
        "air_to_air_k_factor": draw(st.floats(-20.0, 40.0)),
        "fading": draw(st.booleans()) if fading is None else fading,
        "min_secrecy_rate": draw(st.just(0.0) | st.floats(0.01, 2.0)),
        "task_size": tasks[0],
        "cycles_per_bit": tasks[1],
    }
    capacitance = draw(_decades(1e-30, 1e-25))
    largest = largest_task[0] * largest_task[1]
    # Budgets from far too small to ample, relative to what the worst slot needs.
    room = st.sampled_from([1e3, 3.0, 0.7, 0.3, 0.05, 0.01])
    sending = ue_power * slot_duration / len(ues)
    local = capacitance * (largest / slot_duration) ** 3 * slot_duration
    all_offload = local * len(ues) ** 3
    fastest = 0.5 * values["helper_mass"] * slot_duration * 2 * values["max_speed"] ** 2
    values["capacitance"] = capacitance
    values["ue_energy_budget"] = draw(room) * max(sending, local)
    values["edge_energy_budget"] = draw(room) ** 2 * all_offload
    values["helper_energy_budget"] = draw(room) * fastest
    return Scenario(**values)


@st.composite
def helpers(draw: st.DrawFn, scenario: Scenario) -> tuple[float, float]:
    """A helper position: anywhere, where relaying pays, or where jamming pays."""
    half = scenario.map_side / 2
    x, y = draw(coordinates(half))
    target = draw(st.sampled_from(["anywhere", "UEs", "E"]))
    if target == "anywhere":
        return x, y
    around = scenario.eavesdropper_positions[0] if target == "E" else scenario.ue_positions[0]
    near = (around[0] + x / 16, around[1] + y / 16)
    return min(max(near[0], -half), half), min(max(near[1], -half), half)


def actions() -> st.SearchStrategy[tuple[float, float]]:
    """Actions in units of v_max, some beyond the limit and some exactly at rest."""
    axis = st.integers(-96, 96).map(lambda step: step / 64)
    return st.tuples(axis, axis)
