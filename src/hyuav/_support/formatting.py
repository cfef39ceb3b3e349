"""How quantities, shares, intervals and what may never happen are written."""

import math


def in_words(name: str, unit: str) -> str:
    """A field's name in words, with its unit."""
    words = name.replace("_to_air", "-to-air").replace("_k_factor", " K-factor").replace("_", " ")
    if words.startswith("ue "):
        words = f"UE {words[3:]}"
    return f"{words[0].upper()}{words[1:]}" + (f" ({unit})" if unit else "")


def percent(share: float | None, digits: int | None = 1) -> str:
    """A share in percent, "-" where there is none.

    Args:
        share: 1 is 100 %.
        digits: behind the point; None for as many as it has.
    """
    if share is None:
        return "-"
    return f"{100 * share:g} %" if digits is None else f"{100 * share:.{digits}f} %"


def bounds(low: float, high: float, digits: int = 2) -> str:
    """An interval alone."""
    return f"[{low:.{digits}f}, {high:.{digits}f}]"


def interval(middle: float, low: float, high: float, digits: int = 2) -> str:
    """A value with its interval."""
    return f"{middle:.{digits}f} {bounds(low, high, digits)}"


def or_never(value: float, digits: int) -> str:
    """When something happened; infinite where it never did."""
    return f"{value:.{digits}f}" if math.isfinite(value) else "never"
