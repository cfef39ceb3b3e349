"""Learning curves: what each scheme's learners earned as training went on."""

import math
from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from hyuav.experiments.intervals import interquartile_band, interquartile_curve
from hyuav.experiments.schemes import LEARNED
from hyuav.viz.data.schemes import mode_rule, scheme_label, scheme_place

Values = NDArray[np.float64]

SMOOTHING = 25
"""Episodes over which each learner's reward is averaged, the last ones up to each episode."""

NOISY = "accumulated_reward"
"""The quantity that is drawn smoothed; the others are means over evaluation episodes."""

RETURNS = {
    NOISY: "Accumulated reward",
    "evaluation": "Noise-free return",
    "sum_rate": "Noise-free secrecy sum-rate",
    "best_evaluation": "Best noise-free return so far",
}
"""Columns of the metrics that the optimum bounds, and what they are."""

BPS = "bps/Hz"
"""Unit of what is earned by default."""

LAST_EPISODES = 50
"""Over which what a run reached last is averaged."""


class LearningCurve(NamedTuple):
    """What the learners of one scheme and horizon earned."""

    scheme: str
    """A name of :data:`hyuav.experiments.schemes.LABELS`, or an unknown one."""
    num_slots: int
    spacing: float
    """Episodes from a row to the next, as a median."""
    learners: pd.DataFrame
    """A column per learner and a row per episode, or per value of what it is drawn against."""

    @property
    def place(self) -> tuple[int, str, int]:
        """By which curves are sorted: by scheme, then by horizon."""
        return scheme_place(self.scheme), self.scheme, self.num_slots

    def smoothed(self, episodes: int) -> "LearningCurve":
        """The same with each value averaged over the last ``episodes`` up to it."""
        window = max(round(episodes / self.spacing), 1)
        if window == 1:
            return self
        return self._replace(learners=self.learners.rolling(window, min_periods=1).mean())

    def thinned(self, points: int) -> "LearningCurve":
        """The same in at most ``points`` rows, each the mean of neighbours at the last of them."""
        step = math.ceil(len(self.learners) / points)
        if step <= 1:
            return self
        groups = np.arange(len(self.learners)) // step
        last = self.learners.index.to_series().groupby(groups).last()
        means = self.learners.groupby(groups).mean().set_axis(last.to_numpy())
        return self._replace(learners=means)

    def middle(self) -> Values:
        """The interquartile mean over the learners that have not stopped: (rows,)."""
        return interquartile_curve(self.learners.to_numpy(dtype=float))

    def band(self) -> tuple[Values, Values]:
        """The 95 % bootstrap interval of :meth:`middle`: the lower and the upper bounds (rows,)."""
        return interquartile_band(self.learners.to_numpy(dtype=float))


def in_brackets(quantity: str, unit: str) -> str:
    """The unit of a quantity as it stands behind a word; empty where there is none.

    Args:
        quantity: a column of the metrics.
        unit: of the reward.
    """
    unit = BPS if quantity == "sum_rate" else unit if quantity in RETURNS else ""
    return f" ({unit})" if unit else ""


def axis_title(quantity: str, unit: str) -> str:
    """Of a quantity of :data:`RETURNS`, where rewards have this unit."""
    return f"{RETURNS[quantity]}{in_brackets(quantity, unit)}"


def learning_curves(
    metrics: pd.DataFrame, quantity: str = NOISY, against: str = "episode"
) -> Iterator[LearningCurve]:
    """The curves of a run, one for each scheme and horizon in the order of their first rows.

    Args:
        metrics: rows of ``metrics.csv``, whose ``scheme`` is a mode rule as it stands there, or
            a name of :data:`hyuav.experiments.schemes.LABELS`. Columns may be missing.
        quantity: the column that is drawn.
        against: the column of the horizontal axis.
    """
    if not {quantity, against} <= set(metrics.columns):
        return
    rows = metrics.dropna(subset=["episode", against, "learner", "num_slots", quantity])
    rows = rows.assign(scheme=rows["scheme"].replace(LEARNED))
    for (scheme, _), own in rows.groupby(["scheme", "num_slots"], sort=False):
        episodes = np.unique(own["episode"])
        spacing = float(np.median(np.diff(episodes))) if len(episodes) > 1 else 1.0
        num_slots = int(own["num_slots"].iloc[0])
        learners = own.pivot_table(quantity, against, "learner")
        yield LearningCurve(str(scheme), num_slots, spacing, learners)


def learning_table(
    curves: Iterable[LearningCurve], references: Mapping[str, float], training: str = ""
) -> pd.DataFrame:
    """The interquartile mean of what the learners of each scheme earn, episode by episode.

    Args:
        curves: one for each scheme.
        references: as :func:`.references_of`.
        training: what the training is called.

    Returns:
        ``training``, ``scheme``, ``episode``, ``learners``; the ``iqm`` of the
        rewards, each averaged over :data:`SMOOTHING` episodes, its 95 % bootstrap interval
        ``low`` to ``high``, and the ``optimum``, NaN where it is not known.
    """
    tables = []
    for curve in sorted(curves, key=lambda curve: curve.place):
        smooth = curve.smoothed(SMOOTHING)
        low, high = smooth.band()
        columns = {
            "training": training,
            "scheme": curve.scheme,
            "episode": smooth.learners.index,
            "learners": smooth.learners.shape[1],
            "iqm": smooth.middle(),
            "low": low,
            "high": high,
            "optimum": references.get(mode_rule(curve.scheme), np.nan),
        }
        tables.append(pd.DataFrame(columns))
    return pd.concat(tables, ignore_index=True)


def extremes(x: Values, y: Values, points: int) -> tuple[Values, Values]:
    """At most ``points`` points of a line: the lowest and the highest of each stretch.

    Args:
        x: (n,) in order.
        y: (n,), NaN where there is nothing.
        points: how many are kept.
    """
    known = ~np.isnan(y)
    x, y = x[known], y[known]
    if len(x) <= points:
        return x, y
    stretches = np.array_split(np.arange(len(x)), points // 2 - 1)
    lowest_and_highest = [(own[y[own].argmin()], own[y[own].argmax()]) for own in stretches]
    kept = np.unique([0, len(x) - 1, *np.ravel(lowest_and_highest)])
    return x[kept], y[kept]


def quantities(metrics: Mapping[str, pd.DataFrame], unit: str = BPS) -> dict[str, str]:
    """What can be drawn of these runs, with the axis titles; the losses come last.

    Args:
        metrics: by the run's name.
        unit: of their rewards.
    """
    names = dict.fromkeys(name for rows in metrics.values() for name in rows.columns)
    losses = sorted(name for name in names if name.startswith("loss_"))
    known = {name: axis_title(name, unit) for name in RETURNS if name in names}
    return known | {name: f"Loss of the {name.removeprefix('loss_')}" for name in losses}


def last_results(
    metrics: Mapping[str, pd.DataFrame], quantity: str, unit: str = BPS
) -> pd.DataFrame:
    """What each run's learners brought in the end, a row per run, scheme and horizon.

    Args:
        metrics: by the run's name.
        quantity: the column that is told of.
        unit: of their rewards.
    """
    unit = in_brackets(quantity, unit)
    rows = []
    for run, table in metrics.items():
        for curve in learning_curves(table, quantity):
            episodes = curve.learners.index
            means = curve.learners[episodes > episodes.max() - LAST_EPISODES].mean()
            rows.append(
                {
                    "Run": run,
                    "Scheme": scheme_label(curve.scheme),
                    "T": curve.num_slots,
                    "Learners": means.count(),
                    "Episode": int(episodes.max()),
                    f"Last {LAST_EPISODES} episodes, mean{unit}": means.mean(),
                    f"Best learner{unit}": means.max(),
                    f"Worst learner{unit}": means.min(),
                }
            )
    return pd.DataFrame(rows).round(3)
