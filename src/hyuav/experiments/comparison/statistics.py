"""Interquartile means, profiles and probabilities of improvement, with bootstrap intervals.

As recommended by Agarwal et al., "Deep reinforcement learning at the edge of the statistical
precipice", NeurIPS 2021. The quantity is the fraction of the optimum that a learner's best weights
earn. A cell holds the learners of one algorithm, scenario, mode rule and horizon; the learners on
random layouts of a rule and horizon are one cell, each layout being a draw. Intervals are 95 %
percentile intervals of a bootstrap that draws the learners of each cell anew.
"""

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from hyuav.experiments.comparison.plan import LAYOUT
from hyuav.experiments.intervals import Array, interquartile_mean, stratified_interval

LAYOUTS = "layouts"
"""The scenario of the cells that hold the random layouts."""

NEAR_OPTIMAL = 0.95
"""Share of the optimum that is counted beside the threshold."""

_CELL = ["scenario", "scheme", "num_slots"]


def in_cells(rows: pd.DataFrame) -> pd.DataFrame:
    """The same rows, with one name for the scenarios of all random layouts."""
    drawn = rows["scenario"].str.startswith(LAYOUT)
    return rows.assign(scenario=rows["scenario"].mask(drawn, LAYOUTS))


def share(samples: Sequence[Array]) -> Any:
    """Mean of all samples together."""
    return np.concatenate(samples, axis=-1).mean(axis=-1)


def probability_of_improvement(x: Array, y: Array) -> Any:
    """P(X > Y) + P(X = Y) / 2 of samples (..., n) and (..., m): (...)."""
    one, other = x[..., :, np.newaxis], y[..., np.newaxis, :]
    return ((one > other) + 0.5 * (one == other)).mean(axis=(-1, -2))


def summarize_cells(results: pd.DataFrame, threshold: float) -> pd.DataFrame:
    """What is told of each cell.

    Args:
        results: a row for each learner, as :meth:`.shards.Shard.tables` gives them.
        threshold: share of the optimum that counts as solved.

    Returns:
        by ``algorithm``, ``scenario``, ``scheme`` and ``num_slots``: the number of ``learners``;
        the fraction's ``iqm``, its interval ``low`` to ``high`` and the ``worst``;
        ``above_threshold``, the share of learners; and the medians of the episodes and seconds
        until the threshold was reached, inf where half of the learners or more never did; and
        ``no_helper``, the mean share of the optimum that comes without a helper, NaN where older
        results do not tell it.
    """
    rows = []
    for identity, cell in in_cells(results).groupby(["algorithm", *_CELL], sort=False):
        names = dict(zip(["algorithm", *_CELL], identity, strict=True))
        medians = {
            f"median_{column}": np.median(cell[column].fillna(np.inf))
            for column in ("episodes_to_threshold", "seconds_to_threshold")
        }
        alone = {"no_helper": without_helper(cell)}
        described = _described([cell["fraction"].to_numpy()], threshold)
        rows.append(names | described | medians | alone)
    return pd.DataFrame(rows)


def summarize_algorithms(results: pd.DataFrame, threshold: float) -> pd.DataFrame:
    """What is told of each algorithm over all cells.

    Returns:
        by ``algorithm``: the number of ``learners``; the fraction's ``iqm`` with its stratified
        interval ``low`` to ``high``, ``worst`` and ``median``; ``above_threshold`` and
        ``near_optimal``, the shares of learners that reach the threshold and
        :data:`NEAR_OPTIMAL`; ``seconds``, the median that a learner took; and ``no_helper``, as
        :func:`summarize_cells` tells it.
    """
    return pd.DataFrame(
        {
            "algorithm": algorithm,
            **_described(list(_samples(own).values()), threshold),
            "median": own["fraction"].median(),
            "near_optimal": (own["fraction"] >= NEAR_OPTIMAL).mean(),
            "seconds": own["seconds"].median(),
            "no_helper": without_helper(own),
        }
        for algorithm, own in in_cells(results).groupby("algorithm", sort=False)
    )


def without_helper(results: pd.DataFrame) -> float:
    """The mean share of the optimum that comes without a helper; NaN where it is not told.

    Args:
        results: a row for each learner.
    """
    if "no_helper" not in results:
        return float("nan")
    return float((results["no_helper"] / results["optimum"]).mean())


def _described(cells: Sequence[Array], threshold: float) -> dict[str, Any]:
    """What is told of the fractions in one or several cells."""
    fractions = np.concatenate(cells)
    low, high = stratified_interval(cells, interquartile_mean)
    return {
        "learners": len(fractions),
        "iqm": float(interquartile_mean(cells)),
        "low": float(low),
        "high": float(high),
        "worst": fractions.min(),
        "above_threshold": (fractions >= threshold).mean(),
    }


def performance_profiles(results: pd.DataFrame, fractions: ArrayLike) -> pd.DataFrame:
    """The share of learners that reach each fraction of the optimum, by algorithm.

    Args:
        results: a row for each learner.
        fractions: of the optimum, (tau,).

    Returns:
        ``algorithm``, ``fraction``, ``share``, and its pointwise stratified interval ``low`` to
        ``high``.
    """
    grid = np.asarray(fractions, dtype=np.float64)[:, np.newaxis]
    profiles = []
    for algorithm, own in in_cells(results).groupby("algorithm", sort=False):
        reached = [(cell >= grid).astype(np.float64) for cell in _samples(own).values()]
        low, high = stratified_interval(reached, share)
        columns = {"fraction": grid[:, 0], "share": share(reached), "low": low, "high": high}
        profiles.append(pd.DataFrame({"algorithm": algorithm, **columns}))
    return pd.concat(profiles, ignore_index=True)


def improvements(results: pd.DataFrame) -> pd.DataFrame:
    """How probably a learner of one algorithm is better than one of another on the same cell.

    Args:
        results: a row for each learner.

    Returns:
        for each ordered pair ``algorithm`` and ``other``: the mean ``probability`` over the
        cells that both have, with its stratified interval ``low`` to ``high``.
    """
    samples = {
        str(algorithm): _samples(own)
        for algorithm, own in in_cells(results).groupby("algorithm", sort=False)
    }
    rows: list[tuple[str, str, float, float, float]] = []
    for (name, one), (other_name, other) in itertools.combinations(samples.items(), 2):
        cells = [cell for cell in one if cell in other]
        if not cells:
            continue
        both = [*(one[cell] for cell in cells), *(other[cell] for cell in cells)]
        probability = float(_mean_improvement(both))
        low, high = (float(bound) for bound in stratified_interval(both, _mean_improvement))
        rows.append((name, other_name, probability, low, high))
        rows.append((other_name, name, 1.0 - probability, 1.0 - high, 1.0 - low))
    return pd.DataFrame(rows, columns=["algorithm", "other", "probability", "low", "high"])


def _mean_improvement(samples: Sequence[Array]) -> Any:
    """Over the cells, of which the first half of the samples are one algorithm's."""
    half = len(samples) // 2
    pairs = zip(samples[:half], samples[half:], strict=True)
    return np.mean([probability_of_improvement(x, y) for x, y in pairs], axis=0)


def learning_curves(curves: pd.DataFrame) -> pd.DataFrame:
    """The interquartile mean over all learners of an algorithm, evaluation by evaluation.

    A learner that stopped stays at its best; without an evaluation before that, it has no part.

    Args:
        curves: a row for each learner and evaluation, as :meth:`.shards.Shard.tables`
            gives them.

    Returns:
        ``algorithm``, ``episode``, the fraction's ``iqm`` and its stratified interval ``low`` to
        ``high``.
    """
    means = []
    curves = in_cells(curves.assign(layout=curves["scenario"]))
    for algorithm, own in curves.groupby("algorithm", sort=False):
        episodes = np.unique(own["episode"])
        cells = [
            cell.pivot_table("fraction", "episode", ["layout", "seed"], aggfunc="last")
            .reindex(episodes)
            .ffill()
            .to_numpy()
            for _, cell in own.groupby(_CELL, sort=False)
        ]
        low, high = stratified_interval(cells, interquartile_mean)
        columns = {"iqm": interquartile_mean(cells), "low": low, "high": high}
        means.append(pd.DataFrame({"algorithm": algorithm, "episode": episodes, **columns}))
    if not means:  # every learner stopped before its first evaluation
        return pd.DataFrame(columns=["algorithm", "episode", "iqm", "low", "high"])
    return pd.concat(means, ignore_index=True)


def _samples(rows: pd.DataFrame) -> dict[Any, Array]:
    """The fractions in each cell of one algorithm."""
    return {
        identity: cell["fraction"].to_numpy() for identity, cell in rows.groupby(_CELL, sort=False)
    }
