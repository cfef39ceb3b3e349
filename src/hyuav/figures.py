"""The figures: learning curves, flights over the map, and maps of the secrecy sum-rate."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
import torch
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from hyuav.envs.rendering import OKABE_ITO, draw_flight, draw_scenario, mode_handles
from hyuav.evaluation import LABELS
from hyuav.scenario import Scenario
from hyuav.system import SecureOffloadingSystem

COLUMN_WIDTH, PAGE_WIDTH = 3.5, 7.16
"""Inches of one column and of both columns of an IEEE page."""

COLORS = {
    "proposed": OKABE_ITO["bluish green"],
    "ja_ot": OKABE_ITO["vermillion"],
    "re_ot": OKABE_ITO["blue"],
    "re_lt": OKABE_ITO["sky blue"],
    "ja_lt": OKABE_ITO["orange"],
}
"""The same color for a scheme in every figure."""

COLORS |= {f"{scheme}_paper": COLORS[scheme] for scheme in ("proposed", "ja_ot", "re_ot")}

STYLE: Any = {
    "font.size": 8,
    "axes.linewidth": 0.6,
    "lines.linewidth": 1.0,
    "lines.markersize": 3.5,
    "axes.labelsize": 8,
    "legend.fontsize": 7,
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
    "pdf.fonttype": 42,  # fonts that journals' submission checks accept
    "savefig.dpi": 300,
}

FLIGHT_PANELS = {
    "optimum": ["proposed"],
    "re_optimum": ["re_ot", "re_lt"],
    "ja_optimum": ["ja_ot", "ja_lt"],
}
"""The maps of the flight figure: the optimum underneath, and the schemes flown over it."""

SMOOTHING = 25
"""Episodes over which a learning curve is averaged."""


def save_figure(figure: Figure, directory: Path, name: str) -> None:
    """Write the figure as ``name.png`` and ``name.pdf``."""
    directory.mkdir(parents=True, exist_ok=True)
    with mpl.rc_context(STYLE):
        for suffix in ("png", "pdf"):
            figure.savefig(directory / f"{name}.{suffix}")


def learning_curves(
    accumulated_reward: Mapping[str, pd.DataFrame], optima: Mapping[str, float]
) -> Figure:
    """Accumulated reward against episodes (the paper's Fig. 2), with the optimum of each scheme.

    Args:
        accumulated_reward: by scheme, a column per learner and a row per episode, in bps/Hz.
            What the paper's own algorithm learned beside another one is dashed.
        optima: by scheme, what the best flight earns on average, in bps/Hz.
    """
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(COLUMN_WIDTH, 2.6), layout="constrained")
        axes = figure.add_subplot()
        for scheme, rewards in accumulated_reward.items():
            color, episodes = COLORS[scheme], rewards.index
            smooth = rewards.rolling(SMOOTHING, min_periods=1).mean()
            axes.plot(episodes, rewards.mean(axis=1), color=color, alpha=0.25, linewidth=0.4)
            if rewards.shape[1] > 1:
                low, high = smooth.min(axis=1), smooth.max(axis=1)
                axes.fill_between(episodes, low, high, color=color, alpha=0.2, linewidth=0)
            line = (0, (4, 1.5)) if scheme.endswith("_paper") else "solid"
            mean = smooth.mean(axis=1)
            axes.plot(episodes, mean, color=color, ls=line, linewidth=1.3, label=LABELS[scheme])
            if scheme in optima:
                axes.axhline(optima[scheme], color=color, linewidth=0.9, linestyle=(0, (1, 1.5)))
        axes.plot([], [], color="0.3", linewidth=0.9, linestyle=(0, (1, 1.5)), label="its optimum")
        axes.set(xlabel="Episode", ylabel="Accumulated reward (bps/Hz)")
        axes.margins(x=0.0)
        axes.grid(color="0.92", linewidth=0.5)
        axes.legend(loc="lower right", frameon=True, framealpha=0.9, edgecolor="0.8")
        return figure


def flight_map(scenario: Scenario, flights: pd.DataFrame) -> Figure:
    """The schemes' flights (the paper's Fig. 3), a map for each rule of who chooses the mode.

    The best flight lies underneath as a broad grey line; relaying is solid, jamming dashed.

    Args:
        scenario: that was flown.
        flights: a row per slot, as in :attr:`Evaluation.flights`; each scheme's first is drawn.
    """
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(PAGE_WIDTH, 2.9), layout="constrained")
        row: list[Axes] = list(figure.subplots(1, len(FLIGHT_PANELS), sharey=True))
        for axes, (optimum, schemes) in zip(row, FLIGHT_PANELS.items(), strict=True):
            draw_scenario(axes, scenario)
            if len(best := _path(scenario, flights, optimum)) > 1:
                axes.plot(*best.T, color="0.75", linewidth=4.0, zorder=1.5, label="optimum")
            for scheme in schemes:
                slots = _first_flight(flights, scheme)
                if len(slots):
                    path = _path(scenario, flights, scheme)
                    draw_flight(axes, path, slots["relay"], COLORS[scheme], LABELS[scheme])
            axes.set_title(" and ".join(LABELS[scheme] for scheme in schemes), fontsize=8)
            axes.label_outer()
        handles = {
            label: handle
            for axes in row
            for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
        }
        figure.legend(
            handles=[*handles.values(), *mode_handles()],
            loc="outside lower center",
            ncols=6,
            frameon=False,
            columnspacing=1.4,
        )
        return figure


def _first_flight(flights: pd.DataFrame, scheme: str) -> pd.DataFrame:
    return flights[(flights["scheme"] == scheme) & (flights["episode"] == 0)]


def _path(scenario: Scenario, flights: pd.DataFrame, scheme: str) -> NDArray[np.float64]:
    """The start and the position in each slot: (T + 1, 2) m."""
    return np.vstack([scenario.helper_start, _first_flight(flights, scheme)[["x", "y"]].to_numpy()])


def sum_rate_maps(scenario: Scenario, resolution: float = 1.0) -> Figure:
    """The secrecy sum-rate at every helper position, in each mode and in the better of both.

    Without fading; where the UEs can fill the edge server, with tasks of mean size.

    Args:
        scenario: whose map is drawn.
        resolution: of the map in m.
    """
    half = scenario.map_side / 2
    axis = torch.arange(-half, half + resolution / 2, resolution, dtype=torch.float64)
    system = SecureOffloadingSystem(scenario, dtype=torch.float64)
    positions = torch.cartesian_prod(axis, axis).reshape(len(axis), len(axis), 2)
    tasks = system.mean_tasks(positions.shape[:-1]) if system.edge_can_saturate else None
    relay, jamming = (rates.T.numpy() for rates in system.sum_rates(positions, tasks=tasks))
    better = np.maximum(relay, jamming)
    panels = {"Relay": relay, "Jamming": jamming, "Better mode": better}
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(PAGE_WIDTH, 2.55), layout="constrained")
        row: list[Axes] = list(figure.subplots(1, 3, sharey=True))
        for axes, (title, rates) in zip(row, panels.items(), strict=True):
            draw_scenario(axes, scenario)
            image = axes.imshow(
                rates,
                origin="lower",
                extent=(-half, half, -half, half),
                cmap="viridis",
                vmin=0.0,
                vmax=better.max(),
            )
            axes.grid(visible=False)
            axes.set_title(title, fontsize=8)
            axes.label_outer()
        chosen = np.where(better > 0, relay > jamming, np.nan)
        row[2].contour(axis, axis, chosen, levels=[0.5], colors="white", linewidths=0.8)
        figure.colorbar(image, ax=row, label="Secrecy sum-rate (bps/Hz)", pad=0.01)
        return figure
