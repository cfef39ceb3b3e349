"""The model a second time, in scalar loops, and flights in both.

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
from numpy.typing import NDArray
from tensordict import TensorDict

from hyuav import Scenario
from hyuav.physics import slot as package
from hyuav.physics.layout import Nodes
from hyuav.physics.outcome import Control, SlotOutcome
from hyuav.physics.slot import Physics
from hyuav.physics.tasks import Tasks

RELAY, JAMMING = (True,), (False,)
"""The modes of one helper, as those of several are given: True for each that relays."""

STRAIGHT = 0
"""The way of a UE that sends to L itself; i is the way through helper i, counted from 1."""

Numbers = Sequence[float]
Places = Numbers | Sequence[Numbers]
"""The position of one helper, or those of several."""


@dataclass(frozen=True)
class Gains:
    """Channel power gains of one slot, by UE, helper and eavesdropper."""

    g_ul: list[float]
    g_uh: list[list[float]]
    g_ue: list[list[float]]
    g_hl: list[float]
    g_he: list[list[float]]
    g_hh: dict[tuple[int, int], float]
    """By pairs of helpers, in both orders."""


@dataclass(frozen=True)
class Outcome:
    """One slot in one mode of each helper."""

    sum_rate: float
    offloading: list[bool]
    secrecy_rate: list[float]
    ways: list[int]
    margin: float
    """The smallest distance, relative to its scale, of any compared quantity to its threshold."""


@dataclass(frozen=True)
class Slot:
    """One slot in the modes that are chosen, with everything it costs."""

    modes: tuple[bool, ...]
    chosen: Outcome
    by_modes: dict[tuple[bool, ...], Outcome]
    ue_energy: list[float]
    edge_load: float
    transmission_energy: list[float]
    margin: float

    @property
    def relay(self) -> Outcome:
        """With all helpers relaying."""
        return self.by_modes[(True,) * len(self.modes)]

    @property
    def jamming(self) -> Outcome:
        """With all helpers jamming."""
        return self.by_modes[(False,) * len(self.modes)]


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
    nodes = [*s.ue_positions, s.legitimate_position, *s.eavesdropper_positions]
    return [distance(helper, node) for node in nodes]


def several(helpers: Places) -> list[Numbers]:
    """Positions of helpers, from those of several or that of one."""
    return [helpers] if isinstance(helpers[0], int | float) else list(helpers)  # type: ignore[list-item, arg-type]


def gains(s: Scenario, helpers: Places, fading: Numbers | None) -> Gains:
    """Equations 3 and 4.

    ``fading`` holds powers by link: U to L, U x H, U x E, H to L, H x E, and pairs of helpers.
    """
    powers = None if fading is None else iter(fading)
    places, climb = several(helpers), s.altitude - s.eavesdropper_altitude

    def faded(gain: float) -> float:
        return gain if powers is None else gain * next(powers)

    def ground(ue: Numbers, node: Numbers, height: float) -> float:
        length = math.hypot(height, distance(ue, node))
        return faded(s.ground_to_air_gain / length**s.ground_to_air_exponent)

    def level(helper: Numbers, node: Numbers) -> float:
        return faded(s.air_to_air_gain / max(distance(helper, node), 1.0) ** 2)

    def climbing(helper: Numbers, node: Numbers) -> float:
        return faded(s.air_to_air_gain / max(climb**2 + distance(helper, node) ** 2, 1.0))

    g_ul = [ground(ue, s.legitimate_position, s.altitude) for ue in s.ue_positions]
    g_uh = [[ground(ue, place, s.altitude) for place in places] for ue in s.ue_positions]
    g_ue = [
        [ground(ue, node, s.eavesdropper_altitude) for node in s.eavesdropper_positions]
        for ue in s.ue_positions
    ]
    g_hl = [level(place, s.legitimate_position) for place in places]
    g_he = [[climbing(place, node) for node in s.eavesdropper_positions] for place in places]
    g_hh = {}
    for i in range(len(places)):
        for j in range(i + 1, len(places)):
            g_hh[i, j] = g_hh[j, i] = level(places[i], places[j])
    return Gains(g_ul, g_uh, g_ue, g_hl, g_he, g_hh)


def rates(
    s: Scenario,
    g: Gains,
    u: int,
    modes: Sequence[bool],
    way: int,
    power: Numbers | None = None,
) -> tuple[float, float]:
    """R^d_u and R^e_u of UE u that sends ``way``; ``power`` by helper in units of the nominal."""
    share = [1.0] * len(modes) if power is None else power
    jamming = {j: s.jamming_power * share[j] for j, relays in enumerate(modes) if not relays}
    n_l = s.noise_power + sum(p * g.g_hl[j] for j, p in jamming.items())
    n_e = [
        s.noise_power + sum(p * g.g_he[j][e] for j, p in jamming.items())
        for e in range(len(g.g_ue[u]))
    ]
    together = sum if s.eavesdroppers == "colluding" else max
    if way == STRAIGHT:
        heard = together(s.ue_power * g.g_ue[u][e] / noise for e, noise in enumerate(n_e))
        return float(np.log2(1 + s.ue_power * g.g_ul[u] / n_l)), float(np.log2(1 + heard))
    i = way - 1
    p_i = s.relay_power * share[i]
    n_i = s.noise_power + sum(p * g.g_hh[i, j] for j, p in jamming.items())
    second_hop = (p_i * g.g_hl[i] + s.ue_power * g.g_ul[u]) / n_l
    first_hop = s.ue_power * g.g_uh[u][i] / n_i
    heard = together(
        (p_i * g.g_he[i][e] + s.ue_power * g.g_ue[u][e]) / noise for e, noise in enumerate(n_e)
    )
    legitimate = 0.5 * min(np.log2(1 + second_hop), np.log2(1 + first_hop))
    return float(legitimate), float(0.5 * np.log2(1 + heard))


def computation_energy(s: Scenario, cycles: float) -> float:
    """Equation 7 with the frequency that finishes ``cycles`` within a slot."""
    frequency = cycles / s.slot_duration
    return s.capacitance * frequency * frequency * frequency * s.slot_duration


def sending_energy(s: Scenario, way: int) -> float:
    """What a UE spends on offloading, the first term of eq. 8e."""
    share = s.slot_duration / len(s.ue_positions)
    return s.ue_power * (share if way == STRAIGHT else share / 2)


def outcome(
    s: Scenario,
    helpers: Places,
    fading: Numbers | None,
    cycles: Numbers,
    modes: Sequence[bool],
    power: Numbers | None = None,
) -> Outcome:
    """Equations 5, 6, 8e, 8f and 11 for helpers that are forced into ``modes``."""
    g, places = gains(s, helpers, fading), several(helpers)
    ways = [] if all(modes) else [STRAIGHT]
    ways += [i for i, relays in enumerate(modes, start=1) if relays]
    margins = [_relative(sending_energy(s, way), s.ue_energy_budget) for way in ways]
    rate, wants, taken = [], [], []
    for u, position in enumerate(s.ue_positions):
        best: tuple[float, int] | None = None
        first, found = 0.0, []
        for way in ways:
            legitimate, eavesdropper = rates(s, g, u, modes, way, power)
            secrecy = max(legitimate - eavesdropper, 0.0)
            first = secrecy if way == ways[0] else first
            lengths = [distance(position, s.legitimate_position)]
            if way != STRAIGHT:
                lengths.append(distance(position, places[way - 1]))
            margins += [abs(length - s.coverage_radius) / s.map_side for length in lengths]
            scale = 1.0 + legitimate + eavesdropper
            margins.append(abs(legitimate - eavesdropper - s.min_secrecy_rate) / scale)
            covered = all(length <= s.coverage_radius for length in lengths)
            if covered and sending_energy(s, way) <= s.ue_energy_budget:
                found.append(secrecy)
                if best is None or secrecy > best[0]:
                    best = secrecy, way
        found.sort(reverse=True)
        if len(found) > 1 and found[0] > 0.0:
            margins.append((found[0] - found[1]) / (1.0 + found[0]))
        rate.append(first if best is None else best[0])
        taken.append(ways[0] if best is None else best[1])
        wants.append(best is not None and best[0] > s.min_secrecy_rate)
    offloading = _admitted(s, rate, wants, cycles, margins)
    total = sum(r for r, z in zip(rate, offloading, strict=True) if z)
    return Outcome(total, offloading, rate, taken, min(margins))


def no_helper(
    s: Scenario, helpers: Places, fading: Numbers | None, cycles: Numbers
) -> tuple[float, float]:
    """The sum-rate where everybody sends straight to L and nobody helps, and its margin.

    ``helpers`` are where the helpers hover, which matters to nobody: they have draws in ``fading``.
    """
    g, rate, wants, margins = gains(s, helpers, fading), [], [], []
    spent = s.ue_power * s.slot_duration / len(s.ue_positions)
    for u, position in enumerate(s.ue_positions):
        length = distance(position, s.legitimate_position)
        heard = [s.ue_power * gain / s.noise_power for gain in g.g_ue[u]]
        snr = sum(heard) if s.eavesdroppers == "colluding" else max(heard)
        legitimate = math.log2(1 + s.ue_power * g.g_ul[u] / s.noise_power)
        eavesdropper = math.log2(1 + snr)
        rate.append(max(legitimate - eavesdropper, 0.0))
        allowed = length <= s.coverage_radius and spent <= s.ue_energy_budget
        wants.append(allowed and rate[u] > s.min_secrecy_rate)
        excess = (rate[u] - s.min_secrecy_rate) / (1.0 + legitimate + eavesdropper)
        margins += [abs(excess), abs(length - s.coverage_radius) / s.map_side]
        margins.append(_relative(spent, s.ue_energy_budget))
    offloading = _admitted(s, rate, wants, cycles, margins)
    return sum(r for r, z in zip(rate, offloading, strict=True) if z), min(margins)


def _admitted(
    s: Scenario, rate: list[float], wants: list[bool], cycles: Numbers, margins: list[float]
) -> list[bool]:
    """Equation 8f; what is compared is noted in ``margins``."""
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
    return offloading


def fixed_modes(scheme: str, count: int) -> tuple[bool, ...] | None:
    """The modes that a scheme prescribes for so many helpers; None where the best are taken."""
    letters = {"relay": "r" * count, "jamming": "j" * count}.get(scheme, scheme)
    return None if scheme == "hybrid" else tuple(letter == "r" for letter in letters)


def slot(
    s: Scenario,
    scheme: str,
    helpers: Places,
    fading: Numbers | None,
    cycles: Numbers,
    power: Numbers | None = None,
) -> Slot:
    """One slot with the helpers in place: the modes, who offloads which way, and the energies."""
    count = len(several(helpers))
    vectors = [tuple(bool(n >> i & 1) for i in range(count)) for n in range(2**count)]
    by_modes = {k: outcome(s, helpers, fading, cycles, k, power) for k in vectors}
    margin = min(own.margin for own in by_modes.values())
    modes = fixed_modes(scheme, count)
    if modes is None:
        modes = max(vectors, key=lambda k: by_modes[k].sum_rate)  # of equals the first
        first, second = sorted((own.sum_rate for own in by_modes.values()), reverse=True)[:2]
        if first > 0.0:
            margin = min(margin, _relative(first, second))
    chosen = by_modes[modes]
    ue_energy, edge_load = [], 0.0
    for u, z in enumerate(chosen.offloading):
        spent = sending_energy(s, chosen.ways[u]) if z else computation_energy(s, cycles[u])
        ue_energy.append(spent)
        margin = min(margin, _relative(spent, s.ue_energy_budget))
        edge_load += cycles[u] if z else 0.0
    transmission = []
    for i, relays in enumerate(modes):
        share = 1.0 if power is None else power[i]
        ways = zip(chosen.ways, chosen.offloading, strict=True)
        relayed = sum(way == i + 1 and z for way, z in ways)
        relaying = relayed * s.relay_power * s.slot_duration / (2 * len(cycles))
        transmission.append(share * (relaying if relays else s.jamming_power * s.slot_duration))
    return Slot(modes, chosen, by_modes, ue_energy, edge_load, transmission, margin)


def largest_transmission_energy(s: Scenario, scheme: str) -> float:
    """The most that one helper can spend on transmitting in a slot, before its mode is known."""
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


def violations(s: Scenario, ue_energy: Numbers, edge_energy: float, helper_energy: Numbers) -> int:
    """How many nodes spend more than their budget."""
    room = 1.0 + 1e-4  # float32, where a budget is met exactly
    return (
        sum(spent > s.ue_energy_budget * room for spent in ue_energy)
        + (edge_energy > s.edge_energy_budget * room)
        + sum(spent > s.helper_energy_budget * room for spent in helper_energy)
    )


def _relative(a: float, b: float) -> float:
    return abs(a - b) / max(abs(a), abs(b), 1e-300)


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
