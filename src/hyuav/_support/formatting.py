"""How shares, intervals and what may never happen are written in tables."""

import math


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
