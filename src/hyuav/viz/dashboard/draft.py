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
from hyuav.envs.appearance import EAVESDROPPER_LABEL, LEGITIMATE_LABEL
from hyuav.experiments.scenarios import NAMES
from hyuav.physics.scenario import Point, Scenario

Draft = dict[str, Any]
"""A value for each field of :class:`Scenario`: its own, or the text that was typed in."""

LEGITIMATE = "legitimate_position"

NODES = {
    "ue_positions": "UE",
    LEGITIMATE: LEGITIMATE_LABEL,
    "eavesdropper_positions": EAVESDROPPER_LABEL,
    "helper_starts": "helper's start (H)",
}
"""What can be moved, by the field that holds its position or positions."""

SEVERAL = {
    "ue_positions": "UE",
    "eavesdropper_positions": "eavesdropper",
    "helper_starts": "helper",
}
"""The fields of which a scenario may have more or fewer positions, and what stands there."""

COLLUSION = "eavesdroppers"
"""The field that tells whether eavesdroppers work together, which is shown with the nodes."""

_FLIGHT = (
    *("num_slots", "slot_duration", "max_speed", "speed_limit", "off_map_penalty"),
    *("map_side", "altitude", "eavesdropper_altitude", "helper_mass"),
)
_TASKS = (
    *("coverage_radius", "min_secrecy_rate", "task_size", "cycles_per_bit", "capacitance"),
    *("ue_energy_budget", "edge_energy_budget", "helper_energy_budget"),
)

FIELDS = {field.name: field for field in dataclasses.fields(Scenario)}

_RADIO = tuple(name for name in FIELDS if name not in (*NODES, COLLUSION, *_FLIGHT, *_TASKS))

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


def nodes(draft: Draft) -> dict[str, tuple[str, int]]:
    """What can be moved, by name: its field, and its place among the field's positions.

    UEs are numbered from 1, and so are helpers and eavesdroppers where there are several.
    """
    found: dict[str, tuple[str, int]] = {}
    for field, name in NODES.items():
        count = 1 if field == LEGITIMATE else len(draft[field])
        numbered = field == "ue_positions" or count > 1
        for index in range(count):
            found[f"{name} {index + 1}" if numbered else name] = field, index
    return found


def position(draft: Draft, node: str) -> Point:
    """Where a node is, in m."""
    field, index = nodes(draft)[node]
    x, y = draft[field] if field == LEGITIMATE else draft[field][index]
    return float(x), float(y)


def moved(draft: Draft, node: str, to: Point) -> Draft:
    """The draft with a node elsewhere."""
    field, index = nodes(draft)[node]
    if field == LEGITIMATE:
        return {**draft, field: to}
    places = list(draft[field])
    places[index] = to
    return {**draft, field: places}


def with_node(draft: Draft, field: str, at: Point) -> tuple[Draft, str]:
    """The draft with one node more, the last one of its field in :data:`SEVERAL`; and its name."""
    grown = {**draft, field: [*draft[field], at]}
    return grown, [name for name, (own, _) in nodes(grown).items() if own == field][-1]


def without_node(draft: Draft, node: str) -> Draft:
    """The draft without a node; the later ones of its kind move up.

    Raises:
        InputError: it is the only one.
    """
    field, index = nodes(draft)[node]
    if not can_leave(draft, node):
        raise InputError(f"{field}: a scenario has at least one position")
    places = list(draft[field])
    del places[index]
    return {**draft, field: places}


def can_leave(draft: Draft, node: str) -> bool:
    """Whether a node is not the only one of its kind."""
    field, _ = nodes(draft)[node]
    return field in SEVERAL and len(draft[field]) > 1


def changes(scenario: Scenario, original: Scenario) -> dict[str, tuple[str, str]]:
    """What differs from the scenario that was begun with: the old and the new value, as shown.

    Of several positions nothing is shown.
    """
    both: Mapping[str, tuple[object, object]] = {
        name: (getattr(original, name), getattr(scenario, name)) for name in FIELDS
    }
    return {name: _told(name, *pair) for name, pair in both.items() if pair[0] != pair[1]}


def _told(name: str, old: Any, new: Any) -> tuple[str, str]:
    if name in SEVERAL and max(len(old), len(new)) > 1:
        return "", ""
    return shown(old), shown(new)


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
    if name in NAMES:
        raise InputError(rejection("name", name, f"another one than {', '.join(NAMES)}"))
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
