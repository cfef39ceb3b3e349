"""The model a second time, in scalar loops; random worlds to compare both on; flights in both.

No equation here is taken from the package: they are those of the paper, read one UE and one slot
at a time in double precision, so that a mistake in the batched tensors has nowhere to hide.
"""

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from hypothesis import strategies as st
from numpy.typing import NDArray
from tensordict import TensorDict

from hyuav import Scenario
from hyuav.physics import slot as package
from hyuav.physics.layout import Nodes
from hyuav.physics.slot import Control, Physics, SlotOutcome
from hyuav.physics.tasks import Tasks

RELAY, JAMMING = 1, 0

Numbers = Sequence[float]


@dataclass(frozen=True)
class Gains:
    """Channel power gains of one slot."""

    g_ul: list[float]
    g_uh: list[float]
    g_ue: list[float]
    g_hl: float
    g_he: float


@dataclass(frozen=True)
class Outcome:
    """One slot in one mode."""

    sum_rate: float
    offloading: list[bool]
    secrecy_rate: list[float]
    margin: float
    """The smallest distance, relative to its scale, of any compared quantity to its threshold."""


@dataclass(frozen=True)
class Slot:
    """One slot in the mode that is chosen, with everything it costs."""

    mode: int
    chosen: Outcome
    relay: Outcome
    jamming: Outcome
    ue_energy: list[float]
    edge_load: float
    transmission_energy: float
    margin: float


@dataclass(frozen=True)
class Flight:
    """Where one slot's flight ends."""

    position: tuple[float, float]
    velocity: tuple[float, float]
    off_map: bool
    energy: float
    margin: float


def distance(a: Numbers, b: Numbers) -> float:
    return math.sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2)


def distances(s: Scenario, helper: Numbers) -> list[float]:
    nodes = [*s.ue_positions, s.legitimate_position, s.eavesdropper_positions[0]]
    return [distance(helper, node) for node in nodes]


def gains(s: Scenario, helper: Numbers, fading: Numbers | None) -> Gains:
    """Equations 3 and 4; ``fading`` holds U powers to L, U to H, U to E, then H-L and H-E."""
    count = len(s.ue_positions)
    power = [1.0] * (3 * count + 2) if fading is None else list(fading)

    def ground(u: int, node: Numbers, height: float) -> float:
        length = math.hypot(height, distance(s.ue_positions[u], node))
        return s.ground_to_air_gain / length**s.ground_to_air_exponent

    to_legitimate = max(distance(helper, s.legitimate_position), 1.0)
    to_eavesdropper = distance(helper, s.eavesdropper_positions[0])
    climb = s.altitude - s.eavesdropper_altitude
    return Gains(
        g_ul=[ground(u, s.legitimate_position, s.altitude) * power[u] for u in range(count)],
        g_uh=[ground(u, helper, s.altitude) * power[count + u] for u in range(count)],
        g_ue=[
            ground(u, s.eavesdropper_positions[0], s.eavesdropper_altitude) * power[2 * count + u]
            for u in range(count)
        ],
        g_hl=s.air_to_air_gain / to_legitimate**2 * power[3 * count],
        g_he=s.air_to_air_gain / (climb**2 + to_eavesdropper**2) * power[3 * count + 1],
    )


def rates(s: Scenario, g: Gains, u: int, mode: int) -> tuple[float, float]:
    """R^d_u and R^e_u of the rate table."""
    noise = s.noise_power
    if mode == RELAY:
        second_hop = (s.relay_power * g.g_hl + s.ue_power * g.g_ul[u]) / noise
        first_hop = s.ue_power * g.g_uh[u] / noise
        overheard = (s.relay_power * g.g_he + s.ue_power * g.g_ue[u]) / noise
        legitimate = 0.5 * min(np.log2(1 + second_hop), np.log2(1 + first_hop))
        return float(legitimate), float(0.5 * np.log2(1 + overheard))
    at_legitimate = s.ue_power * g.g_ul[u] / (s.jamming_power * g.g_hl + noise)
    at_eavesdropper = s.ue_power * g.g_ue[u] / (s.jamming_power * g.g_he + noise)
    return float(np.log2(1 + at_legitimate)), float(np.log2(1 + at_eavesdropper))


def computation_energy(s: Scenario, cycles: float) -> float:
    """Equation 7 with the frequency that finishes ``cycles`` within a slot."""
    frequency = cycles / s.slot_duration
    return s.capacitance * frequency * frequency * frequency * s.slot_duration


def sending_energy(s: Scenario, mode: int) -> float:
    """What a UE spends on offloading, the first term of eq. 8e."""
    share = s.slot_duration / len(s.ue_positions)
    return s.ue_power * (share / 2 if mode == RELAY else share)


def outcome(
    s: Scenario, helper: Numbers, fading: Numbers | None, cycles: Numbers, mode: int
) -> Outcome:
    """Equations 5, 6, 8e, 8f and 11 for a helper that is forced into ``mode``."""
    g = gains(s, helper, fading)
    margins = []
    rate, wants = [], []
    for u, position in enumerate(s.ue_positions):
        legitimate, eavesdropper = rates(s, g, u, mode)
        rate.append(max(legitimate - eavesdropper, 0.0))
        lengths = [distance(position, s.legitimate_position)]
        if mode == RELAY:
            lengths.append(distance(position, helper))
        covered = all(length <= s.coverage_radius for length in lengths)
        affordable = sending_energy(s, mode) <= s.ue_energy_budget
        wants.append(covered and affordable and legitimate - eavesdropper > s.min_secrecy_rate)
        margins += [abs(length - s.coverage_radius) / s.map_side for length in lengths]
        scale = 1.0 + legitimate + eavesdropper
        margins.append(abs(legitimate - eavesdropper - s.min_secrecy_rate) / scale)
    margins.append(_relative(sending_energy(s, mode), s.ue_energy_budget))

    offloading = [False] * len(wants)
    order = sorted((u for u in range(len(wants)) if wants[u]), key=lambda u: -rate[u])
    load = 0.0
    for rank, u in enumerate(order):
        load += cycles[u]
        spent = computation_energy(s, load)
        margins.append(_relative(spent, s.edge_energy_budget))
        if spent > s.edge_energy_budget:
            if rank > 0:  # which of two UEs came first decided who is left out
                margins.append(rate[order[rank - 1]] - rate[u])
            break
        offloading[u] = True
    total = sum(r for r, z in zip(rate, offloading, strict=True) if z)
    return Outcome(total, offloading, rate, min(margins))


def slot(
    s: Scenario, scheme: str, helper: Numbers, fading: Numbers | None, cycles: Numbers
) -> Slot:
    """One slot with the helper in place: the mode, who offloads, and the energies."""
    relay = outcome(s, helper, fading, cycles, RELAY)
    jamming = outcome(s, helper, fading, cycles, JAMMING)
    margin = min(relay.margin, jamming.margin)
    if scheme == "hybrid":
        mode = RELAY if relay.sum_rate > jamming.sum_rate else JAMMING
        if relay.sum_rate > 0.0 or jamming.sum_rate > 0.0:
            margin = min(margin, _relative(relay.sum_rate, jamming.sum_rate))
    else:
        mode = RELAY if scheme == "relay" else JAMMING
    chosen = relay if mode == RELAY else jamming
    ue_energy, edge_load, transmission = [], 0.0, 0.0
    for u, z in enumerate(chosen.offloading):
        spent = sending_energy(s, mode) if z else computation_energy(s, cycles[u])
        ue_energy.append(spent)
        margin = min(margin, _relative(spent, s.ue_energy_budget))
        edge_load += cycles[u] if z else 0.0
        transmission += s.relay_power * s.slot_duration / (2 * len(cycles)) if z else 0.0
    if mode == JAMMING:
        transmission = s.jamming_power * s.slot_duration
    return Slot(mode, chosen, relay, jamming, ue_energy, edge_load, transmission, margin)


def largest_transmission_energy(s: Scenario, scheme: str) -> float:
    """The most the helper can spend on transmitting in a slot, before its mode is known."""
    relay, jamming = s.relay_power * s.slot_duration / 2, s.jamming_power * s.slot_duration
    return {"relay": relay, "jamming": jamming, "hybrid": max(relay, jamming)}[scheme]


def flight(s: Scenario, scheme: str, position: Numbers, action: Numbers) -> Flight:
    """One slot's flight: speed limit, the helper's energy budget, the map's edge."""
    vx, vy = (s.max_speed * min(max(a, -1.0), 1.0) for a in action)
    norm = math.hypot(vx, vy)
    longest = norm
    if s.speed_limit == "disc":
        longest = min(longest, s.max_speed)
    left = max(s.helper_energy_budget - largest_transmission_energy(s, scheme), 0.0)
    longest = min(longest, math.sqrt(left / (0.5 * s.helper_mass * s.slot_duration)))
    if norm > 0.0:
        vx, vy = vx * longest / norm, vy * longest / norm
    x, y = position[0] + vx * s.slot_duration, position[1] + vy * s.slot_duration
    half = s.map_side / 2
    off_map = not (-half <= x <= half and -half <= y <= half)
    margin = min(abs(abs(x) - half), abs(abs(y) - half)) / s.map_side
    return Flight(
        position=(position[0], position[1]) if off_map else (x, y),
        velocity=(vx, vy),
        off_map=off_map,
        energy=0.5 * s.helper_mass * s.slot_duration * (vx**2 + vy**2),
        margin=margin,
    )


def violations(s: Scenario, ue_energy: Numbers, edge_energy: float, helper_energy: float) -> int:
    """How many nodes spend more than their budget."""
    room = 1.0 + 1e-4  # float32, where a budget is met exactly
    return (
        sum(spent > s.ue_energy_budget * room for spent in ue_energy)
        + (edge_energy > s.edge_energy_budget * room)
        + (helper_energy > s.helper_energy_budget * room)
    )


def _relative(a: float, b: float) -> float:
    return abs(a - b) / max(abs(a), abs(b), 1e-300)


def _decades(low: float, high: float) -> st.SearchStrategy[float]:
    exponents = st.floats(math.log10(low), math.log10(high))
    return exponents.map(lambda exponent: float(10.0**exponent))


def coordinates(half: float) -> st.SearchStrategy[tuple[float, float]]:
    """A point of the map, in steps that both precisions represent exactly."""
    axis = st.integers(-64, 64).map(lambda step: step / 64 * half)
    return st.tuples(axis, axis)


@st.composite
def scenarios(draw: st.DrawFn, fading: bool | None = None) -> Scenario:
    """Random worlds around the paper's, from easy to hopeless, budgets slack and tight."""
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
    altitude = draw(st.floats(5.0, 300.0))
    above = draw(st.sampled_from([-1.0, 1.0])) * draw(st.floats(2.0, 100.0))
    largest_task = [draw(_decades(1e3, 1e6)) for _ in range(2)]
    tasks = [(high * draw(st.floats(0.0, 1.0)), high) for high in largest_task]
    ue_power, slot_duration = draw(_decades(1e-3, 1.0)), draw(st.floats(0.25, 4.0))
    values: dict[str, Any] = {
        "ue_positions": ues,
        "legitimate_position": legitimate,
        "eavesdropper_positions": draw(coordinates(half)),
        "helper_starts": draw(coordinates(half)),
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


def as_list(values: torch.Tensor) -> list[float]:
    """A tensor's numbers, in double precision."""
    return [float(value) for value in values.to(torch.float64).flatten()]


def changed(scenario: Scenario, **changes: Any) -> Scenario:
    return dataclasses.replace(scenario, **changes)


def start_at(env: Any, position: Any) -> Any:
    """Reset the environment with one helper in each row, at ``position`` (*batch_size, 2)."""
    position = torch.as_tensor(position, dtype=torch.float32).unsqueeze(-2)
    return env.reset(TensorDict({"position": position}, batch_size=env.batch_size))


def fly(env: Any, state: Any, action: Any) -> Any:
    """What the next slot brings, physical entries and diagnostics."""
    action = torch.as_tensor(action, dtype=torch.float32).expand(*env.batch_size, 2)
    action = action.reshape(env.action_spec.shape)  # with the helper's axis where it has one
    return env.step(state.clone().set("action", action))["next"]


def with_helper(physics: Physics, position: Any) -> Nodes:
    """The scenario's nodes with the helper at (..., 2) m."""
    position = torch.as_tensor(position, dtype=physics.dtype)
    return physics.nodes._replace(helper=position.unsqueeze(-2))


def hover(
    physics: Physics,
    position: Any,
    fading: torch.Tensor | None = None,
    tasks: Tasks | None = None,
    **control: Any,
) -> SlotOutcome:
    """A slot of the package with the helper at (..., 2) m; the fading comes in rows."""
    links = None if fading is None else physics.link_row.unflatten(fading)
    staying = Control(torch.zeros(1, 2, dtype=physics.dtype), **control)
    return package.slot(physics, with_helper(physics, position), staying, links, tasks)


def place(entries: Any) -> torch.Tensor:
    """Where the one helper of each row is: (..., 2) m."""
    position: torch.Tensor = entries["position"]
    return position.squeeze(-2)


def next_draws(env: Any) -> tuple[list[list[float] | None], list[list[float]]]:
    """The fading powers and CPU cycles, by row, that the environment is about to draw."""
    state = env.draws.state()
    fading, cycles = env.draws.fading(), env.draws.tasks().cpu_cycles.flatten(0, -2)
    env.draws.set_state(state)
    powers: list[list[float] | None] = [None] * len(cycles)
    if fading is not None:
        powers = [as_list(row) for row in fading.flatten(0, -2)]
    return powers, [as_list(row) for row in cycles]


def assert_same(one: Any, other: Any) -> None:
    assert set(one.keys(True, True)) == set(other.keys(True, True))
    for key in one.keys(True, True):
        assert torch.equal(one[key], other[key]), key


def random_actions(*shape: int) -> NDArray[np.float32]:
    return np.random.default_rng(0).uniform(-1.0, 1.0, (*shape, 2)).astype(np.float32)


def torchrl_flight(env: Any, actions: NDArray[np.float32]) -> list[Any]:
    """The entries of each slot when ``actions`` (slots, *batch, 2) are flown in ``env``."""
    state, slots = env.reset(), []
    for action in actions:
        flown = env.step(state.set("action", torch.from_numpy(action)))
        slots.append(flown["next"])
        state = env.step_mdp(flown)
    return slots
