"""What is fixed in an experiment: the node positions and the paper's parameter table."""

import dataclasses
from collections.abc import Sequence
from typing import Annotated, Any, TypeGuard

from pydantic import AfterValidator, BeforeValidator, Field
from pydantic.dataclasses import dataclass

from hyuav._support.errors import InputError, InputTypeError, rejection, require_choice
from hyuav._support.parameters import Fraction, Number, OneOf, Parameters, parameter

LARGEST_LOAD = 1e30
"""Of the energy in J and the power in W to compute all UEs' largest tasks."""

Point = Annotated[tuple[Number, Number], Field(description="two coordinates (x, y) in metres")]
"""Horizontal coordinates (x, y) in metres."""

Points = Annotated[
    tuple[Point, ...],
    Field(
        min_length=1,
        fail_fast=True,
        description="at least one pair of coordinates (x, y) in metres",
    ),
]

# Wider than any real value, and narrow enough for all that follows from them to be in float32.
Length = Annotated[float, Field(ge=1e-6, le=1e9)]
Radius = Annotated[float, Field(ge=0.0, le=1e9)]
Positive = Annotated[float, Field(ge=1e-9, le=1e9)]
Power = Annotated[float, Field(ge=0.0, le=1e6)]
Noise = Annotated[float, Field(ge=1e-24, le=1e6)]
Gain = Annotated[float, Field(ge=0.0, le=1e6)]
Decibel = Annotated[float, Field(ge=-100.0, le=100.0)]
PowerRange = Annotated[
    float, Field(gt=0.0, le=120.0, description="a number of decibels > 0, at most 120")
]
Exponent = Annotated[float, Field(ge=0.0, le=4.0)]
"""Up to 4, where float32 still holds the gains over the longest distances."""

Rate = Annotated[float, Field(ge=0.0, le=1e9)]
Budget = Annotated[float, Field(ge=0.0, le=1e30)]
Load = Annotated[float, Field(ge=0.0, le=1e12)]
Slots = Annotated[int, Field(ge=1, le=10**6)]


def _require_order(pair: tuple[float, float]) -> tuple[float, float]:
    if pair[0] > pair[1]:
        raise ValueError
    return pair


Range = Annotated[
    tuple[Load, Load],
    AfterValidator(_require_order),
    Field(description="two numbers (low, high) with 0 <= low <= high"),
]


def _as_several(value: Any) -> Any:
    """A plain pair of coordinates as the position of one node."""
    pair = isinstance(value, tuple) and value and all(isinstance(x, int | float) for x in value)
    return (value,) if pair else value


LARGEST_NUMBER_OF_HELPERS = 6
"""So many have 64 modes, each of which is tried in each slot."""

Helpers = Annotated[
    tuple[Point, ...],
    BeforeValidator(_as_several),
    Field(
        min_length=1,
        max_length=LARGEST_NUMBER_OF_HELPERS,
        description=f"the positions (x, y) in metres of 1 to {LARGEST_NUMBER_OF_HELPERS} helpers",
    ),
]
Eavesdroppers = Annotated[Points, BeforeValidator(_as_several)]


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

    ue_positions: Points = parameter(symbol="(x_u, y_u)", unit="m")
    legitimate_position: Point = parameter((0.0, 0.0), symbol="(x_L, y_L)", unit="m")
    eavesdropper_positions: Eavesdroppers = parameter(
        ((80.0, 80.0),), symbol="(x_E, y_E)", unit="m"
    )
    helper_starts: Helpers = parameter(((-60.0, -60.0),), symbol="(x_H(0), y_H(0))", unit="m")
    eavesdroppers: Annotated[str, OneOf("independent", "colluding")] = parameter("independent")
    """Whether the best-placed eavesdropper counts, or their SNRs add up."""
    num_slots: Slots = parameter(20, symbol="T")
    slot_duration: Positive = parameter(1.0, symbol="Delta", unit="s")
    map_side: Length = parameter(200.0, symbol="l_max", unit="m")
    altitude: Length = parameter(80.0, symbol="h", unit="m")
    eavesdropper_altitude: Length = parameter(120.0, symbol="h_e", unit="m")
    coverage_radius: Radius = parameter(45.0, symbol="D_max", unit="m")
    max_speed: Positive = parameter(20.0, symbol="v_max", unit="m/s")
    speed_limit: Annotated[str, OneOf("box", "disc")] = parameter("box")
    off_map_penalty: Rate = parameter(0.2, symbol="r_om", unit="bps/Hz")
    helper_mass: Positive = parameter(9.65, symbol="M", unit="kg")
    ue_power: Power = parameter(0.1, symbol="p_u", unit="W")
    jamming_power: Power = parameter(0.08, symbol="p_J", unit="W")
    relay_power: Power = parameter(0.012, symbol="p_R", unit="W")
    power_control: bool = parameter(False)
    """Whether each helper's power is chosen in each slot, from the nominal one of its mode down."""
    power_range: PowerRange = parameter(60.0, symbol="D", unit="dB")
    """How far below the nominal power the least is."""
    noise_power: Noise = parameter(1e-13, symbol="sigma^2", unit="W")
    ground_to_air_gain: Gain = parameter(1e-5, symbol="beta_0")
    ground_to_air_exponent: Exponent = parameter(2.0, symbol="alpha")
    air_to_air_gain: Gain = parameter(1e-4, symbol="beta_1")
    ground_to_air_k_factor: Decibel = parameter(12.0, symbol="K^G2A", unit="dB")
    air_to_air_k_factor: Decibel = parameter(20.0, symbol="K^A2A", unit="dB")
    fading: bool = parameter(True)
    min_secrecy_rate: Rate = parameter(0.1, symbol="epsilon", unit="bps/Hz")
    task_size: Range = parameter((160e3, 240e3), symbol="S_u", unit="bit")
    cycles_per_bit: Range = parameter((1000.0, 1200.0), symbol="F_u", unit="cycle/bit")
    capacitance: Fraction = parameter(1e-27, symbol="kappa")
    ue_energy_budget: Budget = parameter(0.025, symbol="E_u", unit="J")
    edge_energy_budget: Budget = parameter(24.0, symbol="E_L", unit="J")
    helper_energy_budget: Budget = parameter(3900.0, symbol="E_H", unit="J")

    def __post_init__(self) -> None:
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

    @property
    def action_size(self) -> int:
        """Numbers by which one helper is steered: its velocity, and its power where that is."""
        return 3 if self.power_control else 2

    @classmethod
    def preset(cls, name: str) -> "Scenario":
        """The scenario called ``name``, of :data:`PRESETS`.

        Raises:
            InputError: ``name`` is not in :data:`PRESETS`.
        """
        require_choice("scenario", name, PRESETS)
        return PRESETS[name]


_TWO_CLUSTERS = Scenario(
    ue_positions=(
        *((-10.0, 18.0), (-20.0, 18.0), (-26.0, 29.0), (-25.0, 26.0), (-19.0, 15.0)),
        *((-32.0, 12.0), (-35.0, 20.0), (26.0, -16.0), (18.0, -30.0), (23.0, -20.0)),
    )
)

PRESETS: dict[str, Scenario] = {
    "random_disk": Scenario(
        ue_positions=(
            *((23.0, 13.0), (2.0, 30.0), (9.0, -26.0), (-28.0, -16.0), (30.0, 20.0)),
            *((-37.0, 17.0), (-22.0, 3.0), (18.0, 29.0), (-3.0, -35.0), (17.0, 15.0)),
        )
    ),
    "two_clusters": _TWO_CLUSTERS,
    "two_eavesdroppers": dataclasses.replace(
        _TWO_CLUSTERS,
        eavesdropper_positions=((80.0, 80.0), (-80.0, 60.0)),
        helper_starts=((-60.0, -60.0), (60.0, -60.0)),
    ),
    "contested": Scenario(
        ue_positions=(
            *((-80.0, -40.0), (-70.0, -55.0), (-60.0, -70.0), (-85.0, -60.0), (-65.0, -45.0)),
            *((70.0, 60.0), (60.0, 75.0), (80.0, 50.0), (75.0, 70.0), (55.0, 60.0)),
        ),
        eavesdropper_positions=((-60.0, -50.0), (60.0, 55.0)),
        eavesdropper_altitude=100.0,
        helper_starts=((0.0, 0.0), (0.0, 0.0)),
        coverage_radius=120.0,
        jamming_power=1e-4,
    ),
}
"""Scenarios by name: two layouts that reproduce the paper's figures 3a and 3b, one of them with two
eavesdroppers and two helpers, and one in which nothing is secret without helpers."""

Preset = Annotated[str, OneOf(*PRESETS)]

ScenarioLike = Scenario | str | Sequence[Point]
"""A scenario, a preset's name, or UE positions in m, all else being as in the paper."""


def as_scenario(scenario: object) -> Scenario:
    """A scenario as it is, the preset of that name, or the paper's with these UE positions.

    Raises:
        InputError: there is none of that name, or positions are not accepted.
        InputTypeError: it is none of these.
    """
    if isinstance(scenario, str):
        return Scenario.preset(scenario)
    if is_layout(scenario):
        return Scenario(ue_positions=scenario)
    if not isinstance(scenario, Scenario):
        accepted = "a Scenario, a preset's name or UE positions"
        raise InputTypeError(rejection("scenario", scenario, accepted))
    return scenario


def is_layout(value: Any) -> TypeGuard[tuple[Point, ...]]:
    """Whether these are positions (U, 2): pairs of numbers."""
    try:
        first = value[0]
        return not isinstance(first, str) and isinstance(float(first[0]), float)
    except (TypeError, ValueError, LookupError):
        return False
