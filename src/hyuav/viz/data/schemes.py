"""The label, color and line of a scheme, the same in every picture, and the schemes' order."""

from typing import Literal

from hyuav.envs.rendering import OKABE_ITO
from hyuav.experiments.schemes import LABELS, OPTIMA, SCHEMES

COMPARED = ("proposed", "ja_ot", "re_ot", "re_lt", "ja_lt")
"""The five schemes of the paper."""

COLORS = {
    "proposed": OKABE_ITO["bluish green"],
    "ja_ot": OKABE_ITO["vermillion"],
    "re_ot": OKABE_ITO["blue"],
    "re_lt": OKABE_ITO["sky blue"],
    "ja_lt": OKABE_ITO["orange"],
}
"""The color of each scheme; one learned by the paper's own algorithm has that of the scheme."""

COLORS |= {f"{scheme}_paper": COLORS[scheme] for scheme in ("proposed", "ja_ot", "re_ot")}
COLORS |= {
    "optimum": COLORS["proposed"],
    "ja_optimum": COLORS["ja_ot"],
    "re_optimum": COLORS["re_ot"],
}

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
    """Dotted for an optimum, dashed for what only jams, solid for what relays or may."""
    if scheme in OPTIMA.values():
        return "dotted"
    return "dashed" if mode_rule(scheme) == "jamming" else "solid"


def scheme_place(scheme: str) -> int:
    """The scheme's place in the order of every table; unknown ones come last."""
    return list(LABELS).index(scheme) if scheme in LABELS else len(LABELS)
