"""What is fixed in an experiment: the node positions and the paper's parameter table."""

from dataclasses import dataclass
from typing import Any, Self

from hyuav._support.errors import InputError, rejection, require_choice
from hyuav._support.parameters import (
    Parameters,
    choice,
    count,
    increasing_pair,
    number,
    parameter,
    sequence,
    switch,
)

LARGEST_LOAD = 1e30
"""Of the energy in J and the power in W to compute all UEs' largest tasks."""

Point = tuple[float, float]
"""Horizontal coordinates (x, y) in metres."""

PRESETS: dict[str, tuple[Point, ...]] = {
    "random_disk": (
        *((23.0, 13.0), (2.0, 30.0), (9.0, -26.0), (-28.0, -16.0), (30.0, 20.0)),
        *((-37.0, 17.0), (-22.0, 3.0), (18.0, 29.0), (-3.0, -35.0), (17.0, 15.0)),
    ),
    "two_clusters": (
        *((-10.0, 18.0), (-20.0, 18.0), (-26.0, 29.0), (-25.0, 26.0), (-19.0, 15.0)),
        *((-32.0, 12.0), (-35.0, 20.0), (26.0, -16.0), (18.0, -30.0), (23.0, -20.0)),
    ),
}
"""UE positions in metres of the two layouts that reproduce the paper's figures 3a and 3b."""

# Wider than any real value, and narrow enough for all that follows from them to be in float32.
_length, _radius, _flown = number(1e-6, 1e9), number(0.0, 1e9), number(1e-9, 1e9)
_power, _gain, _noise = number(0.0, 1e6), number(0.0, 1e6), number(1e-24, 1e6)
_rate, _budget, _capacitance = number(0.0, 1e9), number(0.0, 1e30), number(0.0, 1.0)
_range = increasing_pair(0.0, 1e12)
_decibel = number(-100.0, 100.0)
_exponent = number(0.0, 4.0)  # up to which float32 holds the gains over the longest distances
_slots = count(1, 10**6)
_point = sequence(number(), "two coordinates (x, y) in metres", length=2)
_points = sequence(_point, "at least one pair of coordinates (x, y) in metres")


def _one_node(name: str, value: Any) -> tuple[Point, ...]:
    """Accept the position of one node, also as a plain pair of coordinates."""
    items = value.tolist() if hasattr(value, "tolist") else value
    if isinstance(items, list | tuple) and items and all(map(_is_scalar, items)):
        items = [items]
    positions: tuple[Point, ...] = _points(name, items)
    if len(positions) > 1:
        raise InputError(rejection(name, value, "the position (x, y) of one node"))
    return positions


def _is_scalar(value: Any) -> bool:
    return hasattr(value, "__float__") and not getattr(value, "ndim", 0)


@dataclass(frozen=True)
class Scenario(Parameters):
    """One experiment's node positions and parameters, checked on creation and immutable.

    Change a scenario with :func:`dataclasses.replace`. Each field's ``metadata`` holds the
    paper's ``symbol`` and the ``unit``. Lists, arrays and tensors are taken where a position
    or a range is expected and kept as tuples of floats.

    Raises:
        InputError: (a ``ValueError``) a value out of its range or a position outside the map.
        InputTypeError: (also a ``TypeError``) a value of the wrong type.

    Example:
        >>> scenario = Scenario.preset("two_clusters")
        >>> dataclasses.replace(scenario, num_slots=10).num_slots
        10
    """

    ue_positions: tuple[Point, ...] = parameter(_points, symbol="(x_u, y_u)", unit="m")
    legitimate_position: Point = parameter(_point, (0.0, 0.0), symbol="(x_L, y_L)", unit="m")
    eavesdropper_positions: tuple[Point, ...] = parameter(
        _one_node, ((80.0, 80.0),), symbol="(x_E, y_E)", unit="m"
    )
    helper_starts: tuple[Point, ...] = parameter(
        _one_node, ((-60.0, -60.0),), symbol="(x_H(0), y_H(0))", unit="m"
    )
    num_slots: int = parameter(_slots, 20, symbol="T")
    slot_duration: float = parameter(_flown, 1.0, symbol="Delta", unit="s")
    map_side: float = parameter(_length, 200.0, symbol="l_max", unit="m")
    altitude: float = parameter(_length, 80.0, symbol="h", unit="m")
    eavesdropper_altitude: float = parameter(_length, 120.0, symbol="h_e", unit="m")
    coverage_radius: float = parameter(_radius, 45.0, symbol="D_max", unit="m")
    max_speed: float = parameter(_flown, 20.0, symbol="v_max", unit="m/s")
    speed_limit: str = parameter(choice("box", "disc"), "box")
    off_map_penalty: float = parameter(_rate, 0.2, symbol="r_om", unit="bps/Hz")
    helper_mass: float = parameter(_flown, 9.65, symbol="M", unit="kg")
    ue_power: float = parameter(_power, 0.1, symbol="p_u", unit="W")
    jamming_power: float = parameter(_power, 0.08, symbol="p_J", unit="W")
    relay_power: float = parameter(_power, 0.012, symbol="p_R", unit="W")
    noise_power: float = parameter(_noise, 1e-13, symbol="sigma^2", unit="W")
    ground_to_air_gain: float = parameter(_gain, 1e-5, symbol="beta_0")
    ground_to_air_exponent: float = parameter(_exponent, 2.0, symbol="alpha")
    air_to_air_gain: float = parameter(_gain, 1e-4, symbol="beta_1")
    ground_to_air_k_factor: float = parameter(_decibel, 12.0, symbol="K^G2A", unit="dB")
    air_to_air_k_factor: float = parameter(_decibel, 20.0, symbol="K^A2A", unit="dB")
    fading: bool = parameter(switch, True)
    min_secrecy_rate: float = parameter(_rate, 0.1, symbol="epsilon", unit="bps/Hz")
    task_size: tuple[float, float] = parameter(_range, (160e3, 240e3), symbol="S_u", unit="bit")
    cycles_per_bit: tuple[float, float] = parameter(
        _range, (1000.0, 1200.0), symbol="F_u", unit="cycle/bit"
    )
    capacitance: float = parameter(_capacitance, 1e-27, symbol="kappa")
    ue_energy_budget: float = parameter(_budget, 0.025, symbol="E_u", unit="J")
    edge_energy_budget: float = parameter(_budget, 24.0, symbol="E_L", unit="J")
    helper_energy_budget: float = parameter(_budget, 3900.0, symbol="E_H", unit="J")

    def __post_init__(self) -> None:
        super().__post_init__()
        self._require_on_map("legitimate_position", self.legitimate_position)
        for name in ("eavesdropper_positions", "helper_starts", "ue_positions"):
            for index, position in enumerate(getattr(self, name)):
                self._require_on_map(f"{name}[{index}]", position)
        self._require_finite_load()

    def _require_on_map(self, name: str, position: Point) -> None:
        half = self.map_side / 2
        if max(abs(position[0]), abs(position[1])) > half:
            accepted = f"a position on the map, x and y in [{-half:g}, {half:g}] m"
            raise InputError(rejection(name, position, accepted))

    def _require_finite_load(self) -> None:
        """Accept tasks whose computing energy, with all UEs offloading, float32 can hold."""
        cycles = self.num_ues * self.task_size[1] * self.cycles_per_bit[1]
        power = (self.capacitance ** (1.0 / 3.0) * cycles / self.slot_duration) ** 3
        if power * max(self.slot_duration, 1.0) > LARGEST_LOAD:
            accepted = f"tasks of all UEs that take at most {LARGEST_LOAD:g} J or W to compute"
            raise InputError(rejection("capacitance", self.capacitance, accepted))

    @property
    def num_ues(self) -> int:
        """U, the number of UEs."""
        return len(self.ue_positions)

    @property
    def num_helpers(self) -> int:
        """H, the number of helpers."""
        return len(self.helper_starts)

    @property
    def num_eavesdroppers(self) -> int:
        """E, the number of eavesdroppers."""
        return len(self.eavesdropper_positions)

    @classmethod
    def preset(cls, name: str) -> Self:
        """The layout called ``name`` with the paper's parameters.

        Raises:
            InputError: ``name`` is not in :data:`PRESETS`.
        """
        require_choice("scenario", name, PRESETS)
        return cls(ue_positions=PRESETS[name])
