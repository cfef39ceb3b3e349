"""What is fixed in an experiment: the node positions and the paper's parameter table."""

import dataclasses
import difflib
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException
from yaml import YAMLError

from hyuav.errors import InputError, InputTypeError, rejection, require_choice

Point = tuple[float, float]
"""Horizontal coordinates (x, y) in metres."""

SPEED_LIMITS = ("box", "disc")

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

Converter = Callable[[str, Any], Any]


def _number(low: float = -math.inf, *, strict: bool = False) -> Converter:
    """Accept finite numbers that are at least ``low`` (above it where ``strict``)."""
    bound = "" if low == -math.inf else f" {'>' if strict else '>='} {low:g}"

    def convert(name: str, value: Any) -> float:
        accepted = f"a finite number{bound}"
        if isinstance(value, bool | str | bytes) or not hasattr(value, "__float__"):
            raise InputTypeError(rejection(name, value, accepted))
        try:
            number = float(value)
        except (TypeError, ValueError, RuntimeError, OverflowError):
            raise InputTypeError(rejection(name, value, accepted)) from None
        if not math.isfinite(number) or number < low or (strict and number == low):
            raise InputError(rejection(name, value, accepted))
        return number

    return convert


def _count(name: str, value: Any) -> int:
    """Accept whole numbers that are at least one."""
    if isinstance(value, bool) or not hasattr(value, "__index__"):
        raise InputTypeError(rejection(name, value, "a whole number >= 1"))
    if (count := value.__index__()) < 1:
        raise InputError(rejection(name, value, "a whole number >= 1"))
    return int(count)


def _switch(name: str, value: Any) -> bool:
    if not isinstance(value, bool):
        raise InputTypeError(rejection(name, value, "true or false"))
    return value


def _speed_limit(name: str, value: Any) -> str:
    require_choice(name, value, SPEED_LIMITS)
    return str(value)


def _sequence(name: str, value: Any, accepted: str) -> list[Any]:
    if hasattr(value, "tolist"):  # a tensor or an array
        value = value.tolist()
    if not isinstance(value, list | tuple):
        raise InputTypeError(rejection(name, value, accepted))
    return list(value)


def _pair(name: str, value: Any, accepted: str, element: Converter) -> tuple[float, float]:
    items = _sequence(name, value, accepted)
    if len(items) != 2:
        raise InputError(rejection(name, value, accepted))
    return element(f"{name}[0]", items[0]), element(f"{name}[1]", items[1])


def _point(name: str, value: Any) -> Point:
    return _pair(name, value, "two coordinates (x, y) in metres", _number())


def _points(name: str, value: Any) -> tuple[Point, ...]:
    accepted = "at least one pair of coordinates (x, y) in metres"
    items = _sequence(name, value, accepted)
    if not items:
        raise InputError(rejection(name, value, accepted))
    return tuple(_point(f"{name}[{index}]", item) for index, item in enumerate(items))


def _range(name: str, value: Any) -> tuple[float, float]:
    accepted = "two numbers (low, high) with 0 <= low <= high"
    low, high = _pair(name, value, accepted, _number(0.0))
    if low > high:
        raise InputError(rejection(name, value, accepted))
    return low, high


def _parameter(default: Any, symbol: str, unit: str, convert: Converter) -> Any:
    metadata = {"symbol": symbol, "unit": unit, "convert": convert}
    if default is dataclasses.MISSING:
        return dataclasses.field(metadata=metadata)
    return dataclasses.field(default=default, metadata=metadata)


_non_negative, _positive = _number(0.0), _number(0.0, strict=True)


@dataclass(frozen=True)
class Scenario:
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

    ue_positions: tuple[Point, ...] = _parameter(dataclasses.MISSING, "(x_u, y_u)", "m", _points)
    legitimate_position: Point = _parameter((0.0, 0.0), "(x_L, y_L)", "m", _point)
    eavesdropper_position: Point = _parameter((80.0, 80.0), "(x_E, y_E)", "m", _point)
    helper_start: Point = _parameter((-60.0, -60.0), "(x_H(0), y_H(0))", "m", _point)
    num_slots: int = _parameter(20, "T", "", _count)
    slot_duration: float = _parameter(1.0, "Delta", "s", _positive)
    map_side: float = _parameter(200.0, "l_max", "m", _positive)
    altitude: float = _parameter(80.0, "h", "m", _positive)
    eavesdropper_altitude: float = _parameter(120.0, "h_e", "m", _positive)
    coverage_radius: float = _parameter(45.0, "D_max", "m", _non_negative)
    max_speed: float = _parameter(20.0, "v_max", "m/s", _positive)
    speed_limit: str = _parameter("box", "", "", _speed_limit)
    off_map_penalty: float = _parameter(0.2, "r_om", "bps/Hz", _non_negative)
    helper_mass: float = _parameter(9.65, "M", "kg", _positive)
    ue_power: float = _parameter(0.1, "p_u", "W", _non_negative)
    jamming_power: float = _parameter(0.08, "p_J", "W", _non_negative)
    relay_power: float = _parameter(0.012, "p_R", "W", _non_negative)
    noise_power: float = _parameter(1e-13, "sigma^2", "W", _positive)
    ground_to_air_gain: float = _parameter(1e-5, "beta_0", "", _non_negative)
    air_to_air_gain: float = _parameter(1e-4, "beta_1", "", _non_negative)
    ground_to_air_k_factor: float = _parameter(12.0, "K^G2A", "dB", _number())
    air_to_air_k_factor: float = _parameter(20.0, "K^A2A", "dB", _number())
    fading: bool = _parameter(True, "", "", _switch)
    min_secrecy_rate: float = _parameter(0.1, "epsilon", "bps/Hz", _non_negative)
    task_size: tuple[float, float] = _parameter((160e3, 240e3), "S_u", "bit", _range)
    cycles_per_bit: tuple[float, float] = _parameter((1e3, 1.2e3), "F_u", "cycle/bit", _range)
    capacitance: float = _parameter(1e-27, "kappa", "", _non_negative)
    ue_energy_budget: float = _parameter(0.025, "E_u", "J", _non_negative)
    edge_energy_budget: float = _parameter(24.0, "E_L", "J", _non_negative)
    helper_energy_budget: float = _parameter(3900.0, "E_H", "J", _non_negative)

    def __post_init__(self) -> None:
        for parameter in dataclasses.fields(self):
            value = getattr(self, parameter.name)
            converted = parameter.metadata["convert"](parameter.name, value)
            object.__setattr__(self, parameter.name, converted)
        for name in ("legitimate_position", "eavesdropper_position", "helper_start"):
            self._require_on_map(name, getattr(self, name))
        for index, position in enumerate(self.ue_positions):
            self._require_on_map(f"ue_positions[{index}]", position)

    def _require_on_map(self, name: str, position: Point) -> None:
        half = self.map_side / 2
        if max(abs(position[0]), abs(position[1])) > half:
            accepted = f"a position on the map, x and y in [{-half:g}, {half:g}] m"
            raise InputError(rejection(name, position, accepted))

    @property
    def num_ues(self) -> int:
        """U, the number of UEs."""
        return len(self.ue_positions)

    @classmethod
    def preset(cls, name: str) -> Self:
        """The layout called ``name`` with the paper's parameters.

        Raises:
            InputError: ``name`` is not in :data:`PRESETS`.
        """
        require_choice("scenario", name, PRESETS)
        return cls(ue_positions=PRESETS[name])

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Self:
        """Build a scenario from plain values, such as a parsed YAML file or command line.

        Raises:
            InputError: an unknown, missing or unacceptable field.
        """
        known = [parameter.name for parameter in dataclasses.fields(cls)]
        for name in values:
            if name not in known:
                similar = difflib.get_close_matches(str(name), known, n=1)
                hint = f"did you mean {similar[0]!r}?" if similar else f"one of {', '.join(known)}"
                raise InputError(f"scenario: unknown field {name!r}: {hint}")
        if "ue_positions" not in values:
            accepted = "at least one pair of coordinates (x, y) in metres"
            raise InputError(f"ue_positions is missing: expected {accepted}")
        return cls(**values)

    def to_dict(self) -> dict[str, Any]:
        """Plain values (numbers, strings, lists), as :meth:`from_dict` takes them."""
        values = dataclasses.asdict(self)
        values["ue_positions"] = [list(position) for position in self.ue_positions]
        return {key: list(v) if isinstance(v, tuple) else v for key, v in values.items()}

    def save(self, path: str | Path) -> None:
        """Write the scenario as YAML."""
        OmegaConf.save(OmegaConf.create(self.to_dict()), path)

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a scenario from a YAML file that :meth:`save` or a person wrote.

        Raises:
            InputError: no such file, not YAML, or not a scenario.
        """
        try:
            values = OmegaConf.to_container(OmegaConf.load(path), resolve=False)
        except (OSError, YAMLError, OmegaConfBaseException, UnicodeDecodeError) as error:
            reason = " ".join(str(error).split())
            raise InputError(f"scenario file {str(path)!r}: cannot be read ({reason})") from None
        if not isinstance(values, dict):
            raise InputError(f"scenario file {str(path)!r}: expected fields with values")
        return cls.from_dict({str(name): value for name, value in values.items()})
