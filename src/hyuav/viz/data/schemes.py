"""The label, color and line of a scheme, the same in every picture, and the schemes' order."""

from typing import Literal

from hyuav.envs.appearance import OKABE_ITO
from hyuav.experiments.schemes import (
    LABELS,
    NO_HELPER,
    OPTIMA,
    OPTIMUM_POWER,
    PROPOSED_POWER,
    SCHEMES,
    Kind,
)

COMPARED = ("proposed", "ja_ot", "re_ot", "re_lt", "ja_lt")
"""The five schemes of the paper."""

DRAWN = (*COMPARED, PROPOSED_POWER, NO_HELPER)
"""What figures of all schemes show."""

BEST = (*OPTIMA.values(), OPTIMUM_POWER)
"""The optima that bound them."""

COLORS = {
    "proposed": OKABE_ITO["bluish green"],
    "ja_ot": OKABE_ITO["vermillion"],
    "re_ot": OKABE_ITO["blue"],
    "generalist": OKABE_ITO["reddish purple"],
    "ja_generalist": "#661100",
    "re_generalist": "#332288",
    "re_lt": OKABE_ITO["sky blue"],
    "ja_lt": OKABE_ITO["orange"],
    NO_HELPER: OKABE_ITO["black"],
    PROPOSED_POWER: "#882255",
}
"""The color of each scheme; one learned by the paper's own algorithm has that of the scheme."""

COLORS |= {f"{scheme}_paper": COLORS[scheme] for scheme in ("proposed", "ja_ot", "re_ot")}
COLORS |= {
    "optimum": COLORS["proposed"],
    "ja_optimum": COLORS["ja_ot"],
    "re_optimum": COLORS["re_ot"],
    OPTIMUM_POWER: COLORS[PROPOSED_POWER],
}

APART = 2.0
"""How many times the rest a value is that would squash the rest, were both on one axis."""

GREY = "#6B6B6B"
"""Of an unknown scheme, and of what stands for all optima."""

Line = Literal["solid", "dashed", "dotted"]


def scheme_color(scheme: str) -> str:
    """The scheme's color; grey for an unknown one."""
    return COLORS.get(scheme, GREY)


def scheme_label(scheme: str) -> str:
    """The scheme's name; an unknown one's stays as it was read."""
    return LABELS.get(scheme, scheme)


def mode_rule(scheme: str) -> str:
    """Who chooses the mode in a scheme; nothing is known of an unknown one."""
    return SCHEMES[scheme].mode_rule if scheme in SCHEMES else ""


def scheme_line(scheme: str) -> Line:
    """Dotted for an optimum, dashed for what only jams, solid for all else."""
    if scheme in SCHEMES and SCHEMES[scheme].kind is Kind.OPTIMUM:
        return "dotted"
    only_jams = mode_rule(scheme) == "jamming" and scheme != NO_HELPER
    return "dashed" if only_jams else "solid"


def is_apart(value: float, highest: float) -> bool:
    """Whether a value is so far above all others, up to ``highest``, that it would squash them."""
    return value > APART * highest


def scheme_place(scheme: str) -> int:
    """The scheme's place in the order of every table; unknown ones come last."""
    return list(LABELS).index(scheme) if scheme in LABELS else len(LABELS)
