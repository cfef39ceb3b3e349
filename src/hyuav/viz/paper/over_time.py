"""What each node spends, and which UEs offload in which mode, slot by slot."""

from collections.abc import Mapping, Sequence

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

from hyuav.experiments.schemes import LABELS
from hyuav.physics.scenario import Scenario
from hyuav.viz.paper.flights import first_flight
from hyuav.viz.paper.maps import MODE_COLORS
from hyuav.viz.paper.style import COLORS, COLUMN_WIDTH, COMPARED, LINES, STYLE

MODE_ROWS = ("proposed", "optimum")
"""The schemes whose helper chooses its mode."""

NOTHING = "0.88"
"""Color of a UE and slot without offloading."""


def energy_table(scenario: Scenario, flights: pd.DataFrame) -> pd.DataFrame:
    """What each node spends in each slot of each scheme's first flight.

    Args:
        scenario: with the budgets.
        flights: a row per slot, as in :attr:`Evaluation.flights`.

    Returns:
        ``scheme``, ``slot``, ``node`` ("UE 1", ..., "L", "H"), ``energy`` and ``budget`` in J. L
        spends in a slot what the tasks taken in the slot before need.
    """
    budgets = {f"UE {u}": scenario.ue_energy_budget for u in range(1, scenario.num_ues + 1)}
    budgets |= {"L": scenario.edge_energy_budget, "H": scenario.helper_energy_budget}
    tables = []
    for scheme, slots in _compared(flights).items():
        spent = np.column_stack(
            [np.stack(slots["ue_energy"].to_list()), slots["edge_energy"], slots["helper_energy"]]
        )
        columns = {
            "scheme": scheme,
            "slot": slots["slot"].to_numpy().repeat(len(budgets)),
            "node": list(budgets) * len(slots),
            "energy": spent.flatten(),
            "budget": list(budgets.values()) * len(slots),
        }
        tables.append(pd.DataFrame(columns))
    return pd.concat(tables, ignore_index=True)


def energy_by_slot(table: pd.DataFrame) -> Figure:
    """The energy of every UE under one scheme, and of L and of the helper under all.

    Args:
        table: of :func:`energy_table`. The UEs are those of its first scheme.
    """
    scheme = str(table["scheme"].iloc[0])
    nodes = {str(name): rows for name, rows in table.groupby("node", sort=False)}
    ues = [rows[rows["scheme"] == scheme] for name, rows in nodes.items() if name[:2] == "UE"]
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(COLUMN_WIDTH, 5.0), layout="constrained")
        of_ues, of_edge, of_helper = figure.subplots(3, sharex=True, height_ratios=(1.5, 1, 1))
        budget = 1e3 * ues[0]["budget"].iloc[0]
        image = _by_ue(of_ues, [1e3 * rows["energy"] for rows in ues], budget)
        label = f"Energy of each UE, {LABELS[scheme]} (mJ; budget {budget:g} mJ)"
        figure.colorbar(image, ax=of_ues, location="top", label=label, aspect=35)
        for axes, node, scale, unit in ((of_edge, "L", 1.0, "J"), (of_helper, "H", 1e-3, "kJ")):
            for name, rows in nodes[node].groupby("scheme", sort=False):
                color, line = COLORS[str(name)], LINES[str(name)]
                label = LABELS[str(name)]
                axes.plot(rows["slot"], scale * rows["energy"], color=color, ls=line, label=label)
            limit = scale * nodes[node]["budget"].iloc[0]
            axes.axhline(limit, color="0.3", linewidth=0.9, linestyle="dashdot")
            axes.set_ylabel(f"Energy of {node} ({unit})")
            axes.grid(color="0.92", linewidth=0.5)
            axes.set_axisbelow(True)
        of_helper.set_xlabel("Slot")
        handles, _ = of_edge.get_legend_handles_labels()
        budget_line = Line2D([], [], color="0.3", linewidth=0.9, linestyle="dashdot")
        budget_line.set_label("budget per slot")
        _legend_below(figure, [*handles, budget_line])
        return figure


def offloading_table(flights: pd.DataFrame) -> pd.DataFrame:
    """Which UEs offload in each slot of the first flight of each scheme and of the optimum.

    Args:
        flights: a row per slot, as in :attr:`Evaluation.flights`.

    Returns:
        ``scheme``, ``slot``, ``relay`` (whether the helper relays), ``ue`` (from 1),
        ``offloading``, and its ``secrecy_rate`` in bps/Hz.
    """
    chosen = ["scheme", "slot", "relay", "offloading", "secrecy_rate"]
    slots = pd.concat(_compared(flights, *MODE_ROWS).values(), ignore_index=True)[chosen]
    slots.insert(3, "ue", [list(range(1, len(ues) + 1)) for ues in slots["offloading"]])
    rows = slots.explode(["ue", "offloading", "secrecy_rate"], ignore_index=True)
    return rows.astype({"ue": int, "offloading": bool, "secrecy_rate": float})


def offloading_by_slot(table: pd.DataFrame) -> Figure:
    """Mode and secrecy rate of every UE over time under one scheme; how many offload under all.

    Args:
        table: of :func:`offloading_table`. The UEs are those of its first scheme.
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
        of_modes.set_yticks(range(1, len(rows) + 1), [LABELS[name] for name in rows])
        image = _by_ue(of_ues, rates, max(own["secrecy_rate"].max(), 0.1))
        label = f"Secrecy rate of each UE, {LABELS[first]} (bps/Hz)"
        figure.colorbar(image, ax=of_ues, location="top", label=label, aspect=35)
        for name in (name for name in schemes if name in COMPARED):
            count = schemes[name].groupby("slot")["offloading"].sum()
            color, line = COLORS[name], LINES[name]
            of_counts.plot(count.index, count, color=color, ls=line, label=LABELS[name])
        of_counts.set(xlabel="Slot", ylabel="UEs that offload", ylim=(0, 1.08 * len(rates)))
        of_counts.yaxis.set_major_locator(MaxNLocator(6, integer=True, steps=[1, 2, 5, 10]))
        of_counts.grid(color="0.92", linewidth=0.5)
        handles, _ = of_counts.get_legend_handles_labels()
        patches = [
            Patch(facecolor=MODE_COLORS[mode], label=f"helper {verb}")
            for mode, verb in (("relay", "relays"), ("jamming", "jams"))
        ]
        patches.append(Patch(facecolor=NOTHING, label="no offloading"))
        _legend_below(figure, [*handles, *patches])
        return figure


def _compared(flights: pd.DataFrame, *besides: str) -> Mapping[str, pd.DataFrame]:
    """The first flight of each scheme that was flown, in the figures' order."""
    schemes = dict.fromkeys((*COMPARED, *besides))
    flown = {scheme: first_flight(flights, scheme) for scheme in schemes}
    return {scheme: slots for scheme, slots in flown.items() if len(slots)}


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


def _legend_below(figure: Figure, handles: list[Line2D | Patch]) -> None:
    figure.legend(
        handles=handles, loc="outside lower center", ncols=3, frameon=False, columnspacing=1.0
    )
