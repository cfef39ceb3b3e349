"""Accumulated reward against episodes: the paper's Fig. 2."""

from collections.abc import Mapping

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from hyuav.experiments.intervals import interquartile_mean, stratified_interval
from hyuav.experiments.schemes import LABELS
from hyuav.viz.paper.style import COLORS, COLUMN_WIDTH, DOTTED, LINES, STYLE

SMOOTHING = 25
"""Episodes over which each learner's reward is averaged, the last ones up to each episode."""


def learning_table(
    rewards: Mapping[str, pd.DataFrame], optima: Mapping[str, float], training: str = ""
) -> pd.DataFrame:
    """The interquartile mean of what the learners of each scheme earn, episode by episode.

    Args:
        rewards: by scheme, a column per learner and a row per episode, in bps/Hz.
        optima: by scheme, what the best flight earns on average, in bps/Hz.
        training: what the training is called.

    Returns:
        ``training``, ``scheme``, ``episode``, ``learners``; in bps/Hz the ``iqm`` of the
        rewards, each averaged over :data:`SMOOTHING` episodes, its 95 % bootstrap interval
        ``low`` to ``high``, and the ``optimum``, NaN where it is not known.
    """
    tables = []
    for scheme in (name for name in LABELS if name in rewards):
        smooth = rewards[scheme].rolling(SMOOTHING, min_periods=1).mean()
        samples = smooth.to_numpy(dtype=np.float64)
        low, high = stratified_interval([samples], interquartile_mean)
        columns = {
            "training": training,
            "scheme": scheme,
            "episode": smooth.index,
            "learners": smooth.shape[1],
            "iqm": interquartile_mean([samples]),
            "low": low,
            "high": high,
            "optimum": optima.get(scheme, np.nan),
        }
        tables.append(pd.DataFrame(columns))
    return pd.concat(tables, ignore_index=True)


def learning_curves(table: pd.DataFrame) -> Figure:
    """Accumulated reward against episodes, with bands, and the optimum of each scheme as a line.

    Args:
        table: of :func:`learning_table`, of one training or several, each of which has a panel.
    """
    trainings = list(dict.fromkeys(table["training"]))
    with mpl.rc_context(STYLE):
        size = (COLUMN_WIDTH, 0.6 + 1.9 * len(trainings))
        figure = Figure(figsize=size, layout="constrained")
        panels = figure.subplots(len(trainings), squeeze=False, sharex=True, sharey=True)[:, 0]
        for axes, training in zip(panels, trainings, strict=True):
            for name, curve in table[table["training"] == training].groupby("scheme", sort=False):
                scheme = str(name)
                color, episodes = COLORS[scheme], curve["episode"]
                axes.axhline(curve["optimum"].iloc[0], color=color, linewidth=0.9, linestyle=DOTTED)
                axes.fill_between(
                    episodes, curve["low"], curve["high"], color=color, alpha=0.2, linewidth=0
                )
                label, line = LABELS[scheme], LINES[scheme]
                axes.plot(episodes, curve["iqm"], color=color, ls=line, lw=1.2, label=label)
            axes.set_title(training)
            axes.margins(x=0.0)
            axes.grid(color="0.92", linewidth=0.5)
            axes.set_axisbelow(True)
        panels[-1].plot([], [], color="0.3", linewidth=0.9, linestyle=DOTTED, label="its optimum")
        panels[-1].set_xlabel("Episode")
        handles, _ = panels[-1].get_legend_handles_labels()
        figure.legend(handles=handles, loc="outside lower center", ncols=4, frameon=False)
        figure.supylabel("Accumulated reward (bps/Hz)", fontsize=8)
        return figure
