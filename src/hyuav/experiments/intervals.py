"""Interquartile means with bootstrap intervals.

As recommended by Agarwal et al., "Deep reinforcement learning at the edge of the statistical
precipice", NeurIPS 2021. A cell holds samples of one kind, as the learners of one algorithm on one
problem; where there are several cells, the bootstrap draws the samples of each anew.
"""

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
import scipy  # whose parts are loaded where they are first used
from numpy.typing import NDArray

Array = NDArray[np.float64]
Statistic = Callable[[Sequence[Array]], Any]
"""Takes samples (..., n) of each cell, returns (...)."""

RESAMPLES, RESAMPLES_AT_ONCE = 2000, 100
SEED = 0
"""Of the bootstrap, so that the same results have the same intervals."""


def interquartile_mean(samples: Sequence[Array]) -> Any:
    """Mean of the middle half of all samples together."""
    return scipy.stats.trim_mean(np.concatenate(samples, axis=-1), 0.25, axis=-1)


def stratified_interval(samples: Sequence[Array], statistic: Statistic) -> tuple[Any, Any]:
    """The 95 % interval of a statistic, each cell's samples being drawn anew from that cell.

    Args:
        samples: (..., n) of each cell; one sample alone is always drawn again.
        statistic: of all cells.

    Returns:
        the lower and the upper bound (...).
    """
    sizes = [own.shape[-1] for own in samples]
    if set(sizes) == {1}:  # drawn anew, they are what they are
        return statistic(samples), statistic(samples)
    # SciPy wants two samples at least: one alone is given twice, and the second is left out.
    given = [np.concatenate([own, own], axis=-1) if own.shape[-1] == 1 else own for own in samples]

    def of_drawn(*drawn: Array, axis: int) -> Any:  # noqa: ARG001 - SciPy's last one
        return statistic([own[..., :size] for own, size in zip(drawn, sizes, strict=True)])

    interval = scipy.stats.bootstrap(
        given,
        of_drawn,
        axis=-1,
        n_resamples=RESAMPLES,
        batch=RESAMPLES_AT_ONCE,
        vectorized=True,
        method="percentile",
        rng=np.random.default_rng(SEED),
    ).confidence_interval
    return interval.low, interval.high


def interquartile_curve(samples: Array) -> Array:
    """The interquartile mean of each row over those of its samples that are known.

    Args:
        samples: (rows, n), NaN where there is none, as of a learner that has stopped.

    Returns:
        the means (rows,), NaN where a row knows none.
    """
    curve = np.full(len(samples), np.nan)
    for rows, own in _known(samples):
        curve[rows] = interquartile_mean([own])
    return curve


def interquartile_band(samples: Array) -> tuple[Array, Array]:
    """The 95 % interval of :func:`interquartile_curve`.

    Args:
        samples: as for that.

    Returns:
        the lower and the upper bounds: (rows,).
    """
    band = np.full((2, len(samples)), np.nan)
    for rows, own in _known(samples):
        band[:, rows] = stratified_interval([own], interquartile_mean)
    return band[0], band[1]


def _known(samples: Array) -> Iterator[tuple[NDArray[np.bool_], Array]]:
    """The rows that know the same samples, and these."""
    known = ~np.isnan(samples)
    for members in np.unique(known[known.any(axis=1)], axis=0):
        rows = (known == members).all(axis=1)
        yield rows, samples[np.ix_(rows, members)]
