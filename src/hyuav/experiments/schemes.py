"""The schemes that are compared, each a whole way to fly, and their names."""

from dataclasses import dataclass
from enum import Enum


class Kind(Enum):
    """Where a scheme's flights come from."""

    LEARNED = "learned"
    LEARNED_AS_IN_PAPER = "learned by the paper's own algorithm, where another one is beside it"
    STRAIGHT = "a straight line"
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

    @property
    def optimum(self) -> str:
        """The scheme that it is measured against: the optimum with the same mode rule."""
        return OPTIMA[self.mode_rule]


SCHEMES = {
    scheme.name: scheme
    for scheme in (
        Scheme("proposed", "Proposed", "hybrid", Kind.LEARNED),
        Scheme("proposed_paper", "Paper Proposed", "hybrid", Kind.LEARNED_AS_IN_PAPER),
        Scheme("ja_ot", "Ja-OT", "jamming", Kind.LEARNED),
        Scheme("ja_ot_paper", "Paper Ja-OT", "jamming", Kind.LEARNED_AS_IN_PAPER),
        Scheme("re_ot", "Re-OT", "relay", Kind.LEARNED),
        Scheme("re_ot_paper", "Paper Re-OT", "relay", Kind.LEARNED_AS_IN_PAPER),
        Scheme("re_lt", "Re-LT", "relay", Kind.STRAIGHT),
        Scheme("ja_lt", "Ja-LT", "jamming", Kind.STRAIGHT),
        Scheme("optimum", "Optimum", "hybrid", Kind.OPTIMUM),
        Scheme("ja_optimum", "Ja-optimum", "jamming", Kind.OPTIMUM),
        Scheme("re_optimum", "Re-optimum", "relay", Kind.OPTIMUM),
    )
}
"""By name, in the order of the tables."""

LABELS = {name: scheme.label for name, scheme in SCHEMES.items()}
"""By name, in the same order."""


def _by_mode_rule(kind: Kind) -> dict[str, str]:
    return {own.mode_rule: own.name for own in SCHEMES.values() if own.kind is kind}


LEARNED = _by_mode_rule(Kind.LEARNED)
"""The learned scheme of each mode rule."""

LEARNED_AS_IN_PAPER = _by_mode_rule(Kind.LEARNED_AS_IN_PAPER)
"""The same by the paper's own algorithm, where another one is beside it."""

OPTIMA = _by_mode_rule(Kind.OPTIMUM)
"""The optimum of each mode rule."""
