"""How nodes and modes are shown, whichever library draws them: colors, labels, runs of slots."""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

OKABE_ITO = {
    "black": "#000000",
    "orange": "#E69F00",
    "sky blue": "#56B4E9",
    "bluish green": "#009E73",
    "yellow": "#F0E442",
    "blue": "#0072B2",
    "vermillion": "#D55E00",
    "reddish purple": "#CC79A7",
}
"""Okabe and Ito's palette, which the colour-blind can tell apart."""

LEGITIMATE_COLOR, EAVESDROPPER_COLOR = "#5A5A5A", "#222222"  # the palette is for schemes and modes
HELPER_COLOR = OKABE_ITO["bluish green"]
UE_COLOR = OKABE_ITO["black"]

LEGITIMATE_LABEL, EAVESDROPPER_LABEL = "legitimate UAV (L)", "eavesdropper (E)"
HELPER_LABEL = "helper UAV (H)"


def runs_of_one_mode(relays: NDArray[np.bool_]) -> Iterator[tuple[bool, int, int]]:
    """Mode, first slot and end of each longest run, so that dashes go on over the slots."""
    changes = np.flatnonzero(relays[1:] != relays[:-1]) + 1
    bounds = [0, *changes.tolist(), len(relays)] if len(relays) else []
    for first, last in pairwise(bounds):
        yield bool(relays[first]), first, last
