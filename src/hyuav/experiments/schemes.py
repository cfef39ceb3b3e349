"""The schemes that are compared, each a whole way to fly, and their names."""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

from hyuav.physics.scenario import Scenario


class Kind(Enum):
    """Where a scheme's flights come from."""

    LEARNED = "learned"
    LEARNED_AS_IN_PAPER = "learned by the paper's own algorithm, where another one is beside it"
    GENERALIST = "one policy for every layout, trained beforehand"
    STRAIGHT = "a straight line"
    NO_HELPER = "nobody flies"
    OPTIMUM = "the exact optimum"


@dataclass(frozen=True)
class Scheme:
    """A whole way to fly: who chooses the helper's mode, and what chooses its trajectory."""

    name: str
    """In files."""
    label: str
    """In tables and figures: the paper's name where it has one."""
    mode_rule: str
    """Who chooses the mode in each slot: hybrid, relay or jamming."""
    kind: Kind
    changes: Mapping[str, Any] = field(default_factory=dict)
    """Fields of the scenario that have other values where it is flown."""

    @property
    def optimum(self) -> str | None:
        """The scheme that it is measured against: the optimum of the same mode rule and changes."""
        own = [
            other.name
            for other in SCHEMES.values()
            if other.kind is Kind.OPTIMUM
            and (other.mode_rule, other.changes) == (self.mode_rule, self.changes)
        ]
        return own[0] if own else None

    def flown_in(self, scenario: Scenario) -> Scenario:
        """The scenario as it is where this scheme is flown."""
        return dataclasses.replace(scenario, **self.changes)


NO_HELPER = "no_helper"
"""Everybody sends straight to L: as in jamming mode, by a helper that hovers and has no power."""

PROPOSED_POWER, OPTIMUM_POWER = "proposed_power", "optimum_power"
"""The helper's power is chosen in each slot, also where the scenario's is the nominal one."""

_POWER = {"power_control": True}


SCHEMES = {
    scheme.name: scheme
    for scheme in (
        Scheme("proposed", "Proposed", "hybrid", Kind.LEARNED),
        Scheme("proposed_paper", "Paper Proposed", "hybrid", Kind.LEARNED_AS_IN_PAPER),
        Scheme("ja_ot", "Ja-OT", "jamming", Kind.LEARNED),
        Scheme("ja_ot_paper", "Paper Ja-OT", "jamming", Kind.LEARNED_AS_IN_PAPER),
        Scheme("re_ot", "Re-OT", "relay", Kind.LEARNED),
        Scheme("re_ot_paper", "Paper Re-OT", "relay", Kind.LEARNED_AS_IN_PAPER),
        Scheme(PROPOSED_POWER, "Proposed, power", "hybrid", Kind.LEARNED, _POWER),
        Scheme("generalist", "Generalist", "hybrid", Kind.GENERALIST),
        Scheme("ja_generalist", "Ja-generalist", "jamming", Kind.GENERALIST),
        Scheme("re_generalist", "Re-generalist", "relay", Kind.GENERALIST),
        Scheme("re_lt", "Re-LT", "relay", Kind.STRAIGHT),
        Scheme("ja_lt", "Ja-LT", "jamming", Kind.STRAIGHT),
        Scheme(NO_HELPER, "No helper", "jamming", Kind.NO_HELPER, {"jamming_power": 0.0}),
        Scheme("optimum", "Optimum", "hybrid", Kind.OPTIMUM),
        Scheme("ja_optimum", "Ja-optimum", "jamming", Kind.OPTIMUM),
        Scheme("re_optimum", "Re-optimum", "relay", Kind.OPTIMUM),
        Scheme(OPTIMUM_POWER, "Optimum, power", "hybrid", Kind.OPTIMUM, _POWER),
    )
}
"""By name, in the order of the tables."""

LABELS = {name: scheme.label for name, scheme in SCHEMES.items()}
"""By name, in the same order."""


def _by_mode_rule(kind: Kind) -> dict[str, str]:
    own = [scheme for scheme in SCHEMES.values() if scheme.kind is kind and not scheme.changes]
    return {scheme.mode_rule: scheme.name for scheme in own}


LEARNED = _by_mode_rule(Kind.LEARNED)
"""The learned scheme of each mode rule."""

LEARNED_AS_IN_PAPER = _by_mode_rule(Kind.LEARNED_AS_IN_PAPER)
"""The same by the paper's own algorithm, where another one is beside it."""

LEARNED_WITH_POWER = {"hybrid": PROPOSED_POWER}
"""The same where the helper's power is controlled, and is not in the scenario beside it."""

GENERALISTS = _by_mode_rule(Kind.GENERALIST)
"""The generalist under each mode rule."""

OPTIMA = _by_mode_rule(Kind.OPTIMUM)
"""The optimum of each mode rule."""
