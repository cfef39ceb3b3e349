"""What each node spends, and which UEs offload in which mode, slot by slot."""

from collections.abc import Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator
from numpy.typing import ArrayLike

from hyuav.viz.data.flights import MODE_ROWS
from hyuav.viz.data.schemes import COLORS, DRAWN, scheme_label, scheme_line
from hyuav.viz.paper.style import (
    COLUMN_WIDTH,
    LINES,
    MODE_COLORS,
    STYLE,
    legend_below,
)

NOTHING = "0.88"
"""Color of a UE and slot without offloading."""


def energy_by_slot(table: pd.DataFrame) -> Figure:
    """The energy of every UE under one scheme, and of L and of the helper under all.

    Where some scheme chooses the helper's power, that is shown below.

    Args:
        table: of :func:`.energy_table`. The UEs are those of its first scheme.
    """
    scheme = str(table["scheme"].iloc[0])
    nodes = {str(name): rows for name, rows in table.groupby("node", sort=False)}
    ues = [rows[rows["scheme"] == scheme] for name, rows in nodes.items() if name[:2] == "UE"]
    with mpl.rc_context(STYLE):
        with_power = "power_level" in table
        figure = Figure(figsize=(COLUMN_WIDTH, 5.0 + 1.3 * with_power), layout="constrained")
        ratios = (1.5, 1, 1, 1) if with_power else (1.5, 1, 1)
        panels: list[Axes] = list(figure.subplots(len(ratios), sharex=True, height_ratios=ratios))
        of_ues, of_edge, of_helper, *of_power = panels
        budget = 1e3 * ues[0]["budget"].iloc[0]
        image = _by_ue(of_ues, [1e3 * rows["energy"] for rows in ues], budget)
        label = f"Energy of each UE, {scheme_label(scheme)} (mJ; budget {budget:g} mJ)"
        figure.colorbar(image, ax=of_ues, location="top", label=label, aspect=35)
        for axes, node, scale, unit in ((of_edge, "L", 1.0, "J"), (of_helper, "H", 1e-3, "kJ")):
            for name, rows in nodes[node].groupby("scheme", sort=False):
                axes.plot(rows["slot"], scale * rows["energy"], **_look(str(name)))
            limit = scale * nodes[node]["budget"].iloc[0]
            axes.axhline(limit, color="0.3", linewidth=0.9, linestyle="dashdot")
            axes.set_ylabel(f"Energy of {node} ({unit})")
            axes.grid()
            axes.set_axisbelow(True)
        for axes in of_power:
            _power_by_slot(axes, nodes["H"])
        panels[-1].set_xlabel("Slot")
        handles, _ = of_edge.get_legend_handles_labels()
        budget_line = Line2D([], [], color="0.3", linewidth=0.9, linestyle="dashdot")
        budget_line.set_label("budget per slot")
        legend_below(figure, [*handles, budget_line], 3)
        return figure


def _power_by_slot(axes: Axes, rows: pd.DataFrame) -> None:
    """The helper's power in each slot, a step for each, under the schemes that choose it."""
    for name, own in rows.dropna(subset="power_level").groupby("scheme", sort=False):
        axes.step(own["slot"], own["power_level"], where="mid", **_look(str(name)))
    axes.axhline(0.0, color="0.3", linewidth=0.9, linestyle="dashdot")
    axes.set_ylabel("Power of H (dB)")
    axes.grid()
    axes.set_axisbelow(True)


def offloading_by_slot(table: pd.DataFrame) -> Figure:
    """Mode and secrecy rate of every UE over time under one scheme; how many offload under all.

    Args:
        table: of :func:`.offloading_table`. The UEs are those of its first scheme.
    """
    schemes = {str(name): rows for name, rows in table.groupby("scheme", sort=False)}
    first, own = next(iter(schemes.items()))
    rows = [name for name in MODE_ROWS if name in schemes] or [first]
    modes = [schemes[name].groupby("slot")["relay"].first() + 1 for name in rows]
    rates = [ue["secrecy_rate"].where(ue["offloading"]) for _, ue in own.groupby("ue")]
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(COLUMN_WIDTH, 4.6), layout="constrained")
        of_modes, of_ues, of_counts = figure.subplots(
            3, sharex=True, height_ratios=(0.16 * len(rows), 1.6, 1.1)
        )
        colors = ListedColormap(list(MODE_COLORS.values()))
        _cells(of_modes, modes, colors, -0.5, 2.5)
        of_modes.set_yticks(range(1, len(rows) + 1), [scheme_label(name) for name in rows])
        image = _by_ue(of_ues, rates, max(own["secrecy_rate"].max(), 0.1))
        label = f"Secrecy rate of each UE, {scheme_label(first)} (bps/Hz)"
        figure.colorbar(image, ax=of_ues, location="top", label=label, aspect=35)
        for name in (name for name in schemes if name in DRAWN):
            count = schemes[name].groupby("slot")["offloading"].sum()
            of_counts.plot(count.index, count, **_look(name))
        of_counts.set(xlabel="Slot", ylabel="UEs that offload", ylim=(0, 1.08 * len(rates)))
        of_counts.yaxis.set_major_locator(MaxNLocator(6, integer=True, steps=[1, 2, 5, 10]))
        of_counts.grid()
        handles, _ = of_counts.get_legend_handles_labels()
        patches = [
            Patch(facecolor=MODE_COLORS[mode], label=f"helper {verb}")
            for mode, verb in (("relay", "relays"), ("jamming", "jams"))
        ]
        patches.append(Patch(facecolor=NOTHING, label="no offloading"))
        legend_below(figure, [*handles, *patches], 3)
        return figure


def _look(scheme: str) -> dict[str, Any]:
    """A scheme's curve, as :meth:`matplotlib.axes.Axes.plot` takes it."""
    line = LINES[scheme_line(scheme)]
    return {"color": COLORS[scheme], "linestyle": line, "label": scheme_label(scheme)}


def _cells(
    axes: Axes, rows: Sequence[ArrayLike], colors: str | ListedColormap, low: float, high: float
) -> AxesImage:
    """A row of colored cells for each of ``rows``, with a cell for each slot, from 1."""
    values = np.stack([np.asarray(row, dtype=float) for row in rows])
    extent = (0.5, values.shape[1] + 0.5, len(rows) + 0.5, 0.5)
    image = axes.imshow(values, aspect="auto", extent=extent, cmap=colors, vmin=low, vmax=high)
    axes.xaxis.set_major_locator(MaxNLocator(10, integer=True))
    axes.set_yticks(np.arange(1.5, len(rows)), minor=True)
    axes.grid(visible=True, which="minor", axis="y", color="white", linewidth=0.6)
    axes.tick_params(which="minor", length=0)
    return image


def _by_ue(axes: Axes, rows: Sequence[ArrayLike], highest: float) -> AxesImage:
    image = _cells(axes, rows, "viridis", 0.0, highest)
    axes.set_facecolor(NOTHING)
    axes.set_ylabel("UE")
    axes.yaxis.set_major_locator(MaxNLocator(6, integer=True, min_n_ticks=1))
    return image
