"""Scenarios by name: presets, and layouts that are drawn from a seed."""

from typing import Any

from hyuav._support.errors import require_choice
from hyuav._support.parameters import mapping
from hyuav.physics.families import LAYOUTS, drawn_scenario
from hyuav.physics.scenario import PRESETS, Scenario

NAMES = (*PRESETS, *LAYOUTS)
"""What a scenario is chosen by."""


def named_scenario(values: object) -> tuple[str, Scenario]:
    """A scenario and its name, from a preset's or a layout's name or from fields with a ``name``.

    Where ``layout`` is among the fields, UEs are drawn, as :func:`.families.drawn_scenario` says;
    the name of a layout gets the seed behind it.

    Raises:
        InputError: an unknown name or field, or an unacceptable value.
    """
    if isinstance(values, str):
        return named_scenario({"name": values, **offered(values)})
    fields = mapping("scenario", values)
    name = str(fields.pop("name", fields.get("layout", "custom")))
    if "layout" in fields:
        scenario, seed = drawn_scenario(fields)
        name = f"{name}-{seed}" if name == fields["layout"] else name
    else:
        preset = PRESETS[name].to_dict() if name in PRESETS else {}
        scenario = Scenario.from_dict({**preset, **fields})
    return name, scenario


def offered(name: str) -> dict[str, Any]:
    """All fields of a preset, or of a layout to be drawn, with their defaults.

    Raises:
        InputError: ``name`` is not in :data:`NAMES`.
    """
    if name not in LAYOUTS:
        require_choice("scenario", name, NAMES)
        return Scenario.preset(name).to_dict()
    constants = Scenario.preset(next(iter(PRESETS))).to_dict()
    del constants["ue_positions"]
    return {"layout": name, **LAYOUTS[name]().to_dict(), "seed": 0, **constants}
