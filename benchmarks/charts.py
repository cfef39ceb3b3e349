"""The benchmark's figures: bars of the training rates, the environment's rates, and scaling."""

from collections.abc import Callable
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullFormatter, NullLocator

from benchmarks.results import Results
from benchmarks.tables import LABELS, VARIED, label
from hyuav.envs.appearance import OKABE_ITO
from hyuav.viz.paper.style import COLUMN_WIDTH, PAGE_WIDTH, STYLE, save_figure

COLORS = {
    "hyuav": OKABE_ITO["bluish green"],
    "hyuav_again": OKABE_ITO["bluish green"],
    "hyuav_robust": OKABE_ITO["bluish green"],
    "stable_baselines3": OKABE_ITO["vermillion"],
    "sbx": OKABE_ITO["blue"],
    "cleanrl": OKABE_ITO["orange"],
    "torchrl": OKABE_ITO["sky blue"],
    "make_env": OKABE_ITO["bluish green"],
    "compiled_env": OKABE_ITO["blue"],
    "random_numbers": OKABE_ITO["black"],
    "numpy": OKABE_ITO["vermillion"],
}
"""The same color for an entry in every figure."""

MARKERS = ("o", "s", "^", "D", "v")


def draw(results: Results, directory: Path) -> None:
    """Write the figures of the parts that were measured, as PNG and PDF."""
    summary = results.summary()
    figures: dict[str, tuple[Callable[[pd.DataFrame], Figure], tuple[str, ...]]] = {
        "training": (training_bars, ("training",)),
        "environment": (environment_rates, ("environment",)),
        "scaling": (scaling_curves, tuple(VARIED)),
    }
    for name, (make, parts) in figures.items():
        rows = summary[summary["part"].isin(parts)]
        if len(rows):
            save_figure(make(rows), directory, name)


def training_bars(rows: pd.DataFrame) -> Figure:
    """Training steps/s of each entry, labelled with the ratio to Stable-Baselines3.

    Args:
        rows: of the summary's part ``training``.
    """
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(COLUMN_WIDTH, 0.7 + 0.27 * len(rows)), layout="constrained")
        axes = figure.add_subplot()
        rows = rows.sort_values("median")
        names = [label(row) for _, row in rows.iterrows()]
        errors = np.stack([rows["median"] - rows["low"], rows["high"] - rows["median"]])
        bars = axes.barh(
            names,
            rows["median"],
            xerr=errors,
            color=[COLORS[entry] for entry in rows["entry"]],
            height=0.65,
            error_kw={"linewidth": 0.6, "capsize": 1.5},
        )
        ratios = rows["ratio_to_stable_baselines3"]
        rates = rows["median"]
        texts = [
            f"{rate:,.0f}" + ("" if pd.isna(ratio) else f" ({ratio:.1f} x SB3)")
            for rate, ratio in zip(rates, ratios, strict=True)
        ]
        axes.bar_label(bars, texts, padding=2, fontsize=7)
        axes.set(xlabel="Training steps per second")
        axes.set_xlim(0.0, 1.45 * rows["high"].max())
        axes.spines[["top", "right"]].set_visible(False)
        _mark_floor(axes, rows)
        return figure


def _mark_floor(axes: Axes, rows: pd.DataFrame) -> None:
    """A line at the arithmetic floor's steps/s, where all ran on the processor."""
    if set(rows["device"]) != {"cpu"}:
        return
    floor = rows["floor"].max()
    axes.axvline(floor, color="0.3", linewidth=0.9, linestyle=(0, (1, 1.5)))
    axes.set_xlim(0.0, max(axes.get_xlim()[1], 1.05 * floor))
    axes.annotate(
        "arithmetic floor",
        (floor, 1.0),
        xycoords=axes.get_xaxis_transform(),
        xytext=(0, 2),
        textcoords="offset points",
        ha="right",
        va="bottom",
        fontsize=7,
        color="0.3",
    )


def environment_rates(rows: pd.DataFrame) -> Figure:
    """Slots/s against the batch size, with the draws' rate above and the NumPy line below.

    Args:
        rows: of the summary's part ``environment``.
    """
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(COLUMN_WIDTH, 2.6), layout="constrained")
        axes = figure.add_subplot()
        batched = rows[rows["entry"] != "numpy"]
        for (name, device), group in batched.groupby(["entry", "device"], sort=False):
            group = group.sort_values("helpers")
            on_gpu = device != "cpu"
            axes.plot(
                group["helpers"],
                group["median"],
                color=COLORS[str(name)],
                linestyle="--" if on_gpu or name == "random_numbers" else "-",
                marker="s" if on_gpu else "o",
                label=LABELS[str(name)] + (", GPU" if on_gpu else ""),
            )
        numpy = float(rows[rows["entry"] == "numpy"]["median"].iloc[0])
        axes.axhline(
            numpy, color=COLORS["numpy"], linewidth=0.9, linestyle=":", label="NumPy, one helper"
        )
        axes.set(xscale="log", yscale="log", xlabel="Batch size", ylabel="Slots per second")
        axes.grid(color="0.92", linewidth=0.5)
        axes.legend(loc="best", frameon=True, framealpha=0.9, edgecolor="0.8")
        return figure


def scaling_curves(rows: pd.DataFrame) -> Figure:
    """Training steps/s, and below it peak memory, against learners, UEs and slots.

    Args:
        rows: of the summary's parts ``learners``, ``ues`` and ``horizon``.
    """
    headings = {"learners": "Learners", "ues": "UEs", "horizon": "Slots per episode"}
    parts = [part for part in headings if (rows["part"] == part).any()]
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(PAGE_WIDTH, 3.6), layout="constrained")
        grid = figure.subplots(2, len(parts), squeeze=False, sharex="col")
        for column, part in enumerate(parts):
            chosen = rows[rows["part"] == part]
            for line, quantity in enumerate(("median", "peak_mebibytes")):
                _draw_curves(grid[line, column], chosen, part, quantity)
            grid[1, column].set_xlabel(headings[part])
        grid[0, 0].set_ylabel("Steps per second")
        grid[1, 0].set_ylabel("Peak memory (MiB)")
        labelled: dict[str, Artist] = {}
        for axes in grid[0]:
            for handle, name in zip(*axes.get_legend_handles_labels(), strict=True):
                labelled.setdefault(name, handle)
        figure.legend(
            list(labelled.values()),
            list(labelled),
            loc="outside lower center",
            ncols=5,
            frameon=False,
        )
        return figure


def _draw_curves(axes: Axes, rows: pd.DataFrame, part: str, quantity: str) -> None:
    varied = VARIED[part]
    identity = ["entry", "device"] if part == "learners" else ["entry", "device", "learners"]
    for number, (_, group) in enumerate(rows.groupby(identity, sort=False)):
        group = group.sort_values(varied)
        first = group.iloc[0]
        several = part != "learners" and first["learners"] > 1
        axes.plot(
            group[varied],
            group[quantity],
            color=COLORS[first["entry"]],
            linestyle="--" if several else "-",
            marker=MARKERS[number % len(MARKERS)],
            label=label(first),
        )
    axes.set(xscale="log")
    if quantity == "median":
        low, high = np.log10([rows[quantity].min(), rows[quantity].max()])
        axes.set(yscale="log", ylim=(0.8 * 10.0 ** np.floor(low), 1.25 * 10.0 ** np.ceil(high)))
        axes.yaxis.set_minor_formatter(NullFormatter())
    else:
        axes.set_ylim(bottom=0.0, top=1.12 * axes.get_ylim()[1])
    values = sorted(set(rows[varied]))
    shown = values if len(values) <= 7 else values[:: -(-len(values) // 7)]
    axes.xaxis.set_major_locator(FixedLocator(shown))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.grid(color="0.92", linewidth=0.5)
