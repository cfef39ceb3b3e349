"""A scenario under change: what a person has entered so far, whether acceptable or not."""

import dataclasses
import re
import typing
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from hyuav._support.errors import InputError, rejection
from hyuav._support.formatting import in_words
from hyuav._support.parameters import OneOf, declared
from hyuav.envs.rendering import EAVESDROPPER_LABEL, LEGITIMATE_LABEL
from hyuav.physics.scenario import PRESETS, Point, Scenario

Draft = dict[str, Any]
"""A value for each field of :class:`Scenario`: its own, or the text that was typed in."""

NODES = {
    "legitimate_position": LEGITIMATE_LABEL,
    "eavesdropper_positions": EAVESDROPPER_LABEL,
    "helper_starts": "helper's start (H)",
}
"""The nodes that every scenario has, beside the UEs."""

_FLIGHT = (
    *("num_slots", "slot_duration", "max_speed", "speed_limit", "off_map_penalty"),
    *("map_side", "altitude", "eavesdropper_altitude", "helper_mass"),
)
_TASKS = (
    *("coverage_radius", "min_secrecy_rate", "task_size", "cycles_per_bit", "capacitance"),
    *("ue_energy_budget", "edge_energy_budget", "helper_energy_budget"),
)

FIELDS = {field.name: field for field in dataclasses.fields(Scenario)}

_RADIO = tuple(name for name in FIELDS if name not in (*NODES, "ue_positions", *_FLIGHT, *_TASKS))

GROUPS = {"Flight": _FLIGHT, "Radio": _RADIO, "Tasks": _TASKS}
"""All parameters but the positions; what has no other group is of the radio."""

KINDS: dict[str, Any] = typing.get_type_hints(Scenario)

CHOICES = {
    name: check.choices
    for name, annotation in typing.get_type_hints(Scenario, include_extras=True).items()
    for check in declared(annotation).metadata
    if isinstance(check, OneOf)
}
"""What a field may be of which the scenario accepts these words alone."""

SCENARIOS = "scenario"
"""Directory below the runs in which scenarios are saved: the name of Hydra's group."""

_FILE_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,63}")


def label(name: str) -> str:
    """A field's name and unit."""
    return in_words(name, FIELDS[name].metadata["unit"])


def shown(value: object) -> str:
    """A value as a person types it; two of them are separated by a comma."""
    if isinstance(value, tuple | list):
        return ", ".join(shown(entry) for entry in value)
    return f"{value:.12g}" if isinstance(value, float) else str(value)


def read(name: str, text: str) -> Any:
    """What was typed into a field; what is no number stays text, for the scenario to refuse."""
    if KINDS[name] is not float:
        return [_number(part) for part in text.split(",")]
    return _number(text)


def _number(text: str) -> Any:
    try:
        return float(text)
    except ValueError:
        return text.strip()


def nodes(draft: Draft) -> list[str]:
    """What can be moved: the UEs, numbered from 1, and the UAVs."""
    return [*(f"UE {n}" for n in range(1, len(draft["ue_positions"]) + 1)), *NODES.values()]


def position(draft: Draft, node: str) -> Point:
    """Where a node is, in m."""
    if node.startswith("UE "):
        x, y = draft["ue_positions"][int(node[3:]) - 1]
    else:
        place = draft[_field(node)]
        x, y = place if _field(node) == "legitimate_position" else place[0]
    return float(x), float(y)


def moved(draft: Draft, node: str, to: Point) -> Draft:
    """The draft with a node elsewhere."""
    if not node.startswith("UE "):
        field = _field(node)
        return {**draft, field: to if field == "legitimate_position" else [to]}
    ues = list(draft["ue_positions"])
    ues[int(node[3:]) - 1] = to
    return {**draft, "ue_positions": ues}


def _field(node: str) -> str:
    return next(field for field, label in NODES.items() if label == node)


def with_ue(draft: Draft, at: Point) -> Draft:
    """The draft with one UE more, the last one."""
    return {**draft, "ue_positions": [*draft["ue_positions"], at]}


def without_ue(draft: Draft, node: str) -> Draft:
    """The draft without a UE; the later ones move up.

    Raises:
        InputError: it is the only one.
    """
    ues = list(draft["ue_positions"])
    if len(ues) == 1:
        raise InputError("ue_positions: a scenario has at least one UE")
    del ues[int(node[3:]) - 1]
    return {**draft, "ue_positions": ues}


def changes(scenario: Scenario, original: Scenario) -> dict[str, tuple[str, str]]:
    """What differs from the scenario that was begun with: the old and the new value, as shown."""
    both: Mapping[str, tuple[object, object]] = {
        name: (getattr(original, name), getattr(scenario, name)) for name in FIELDS
    }
    return {name: (shown(old), shown(new)) for name, (old, new) in both.items() if old != new}


def save(scenario: Scenario, root: Path, name: str, *, replace: bool = False) -> Path:
    """Write a scenario where ``--config-dir ROOT scenario=NAME`` finds it.

    Args:
        scenario: to write.
        root: of the runs.
        name: of the scenario: letters, digits, ``_`` and ``-``.
        replace: whether one of that name gives way.

    Raises:
        InputError: an unacceptable name or one that is taken, or a place that cannot be written.
    """
    if _FILE_NAME.fullmatch(name) is None:
        accepted = "up to 64 letters, digits, '_' and '-', a letter or digit first"
        raise InputError(rejection("name", name, accepted))
    if name in PRESETS:
        raise InputError(rejection("name", name, f"another one than {', '.join(PRESETS)}"))
    path = root / SCENARIOS / f"{name}.yaml"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        if not path.parent.resolve().is_relative_to(root.resolve()):
            raise InputError(rejection("name", name, f"a place below {root}"))
        if replace:
            path.unlink(missing_ok=True)
        path.touch(exist_ok=False)
        scenario.save(path)
    except FileExistsError:
        accepted = "one that is not taken, or to replace it"
        raise InputError(rejection("name", name, accepted)) from None
    except OSError as error:
        accepted = f"a writable place ({error.strerror})"
        raise InputError(rejection("name", str(path), accepted)) from None
    return path


def saved(root: Path) -> list[str]:
    """The names of the scenarios that are saved, links excepted."""
    files = (root / SCENARIOS).glob("*.yaml") if not (root / SCENARIOS).is_symlink() else ()
    return sorted(
        file.stem for file in files if _FILE_NAME.fullmatch(file.stem) and not file.is_symlink()
    )


def load(root: Path, name: str) -> Scenario:
    """Read a scenario that was saved.

    Raises:
        InputError: there is no such scenario, or the file does not hold one.
    """
    if name not in saved(root):
        raise InputError(rejection("scenario", name, "one that was saved"))
    return Scenario.load(root / SCENARIOS / f"{name}.yaml")
