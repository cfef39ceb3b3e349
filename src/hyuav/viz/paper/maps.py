"""Maps of the secrecy sum-rate over the helper's position."""

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from hyuav.envs.rendering import draw_scenario
from hyuav.experiments.schemes import NO_HELPER
from hyuav.physics.scenario import Scenario
from hyuav.viz.paper.style import COLUMN_WIDTH, MODE_COLORS, STYLE, legend_below


def sum_rate_maps(scenario: Scenario, table: pd.DataFrame) -> Figure:
    """The secrecy sum-rate in relay, in jamming and in the better mode, and which one that is.

    What comes without a helper, wherever that would be, is told as a number.

    Args:
        scenario: whose map is drawn.
        table: of :meth:`.HelperMap.table`.
    """
    half, side = scenario.map_side / 2, round(len(table) ** 0.5)
    relay, jamming, better = (
        table[name].to_numpy().reshape(side, side) for name in ("relay", "jamming", "better")
    )
    chosen = np.where(better > 0, np.where(relay > jamming, 2, 1), 0)
    extent = (-half, half, -half, half)
    with mpl.rc_context(STYLE | {"lines.markersize": 2.5}):
        figure = Figure(figsize=(COLUMN_WIDTH, 4.2), layout="constrained")
        panels: list[Axes] = list(figure.subplots(2, 2, sharex=True, sharey=True).flatten())
        titles = ("Relay", "Jamming", "Better mode", "Which is better")
        for axes, title in zip(panels, titles, strict=True):
            draw_scenario(axes, scenario)
            axes.grid(visible=False)
            axes.set_title(title)
            axes.label_outer()
        for axes, rates in zip(panels, (relay, jamming, better), strict=False):
            image = axes.imshow(
                rates, origin="lower", extent=extent, cmap="viridis", vmin=0.0, vmax=better.max()
            )
        of_one = " of one helper alone (bps/Hz);\n" if scenario.num_helpers > 1 else " (bps/Hz); "
        label = f"Secrecy sum-rate{of_one}without a helper {table[NO_HELPER].iloc[0]:.2f}"
        figure.colorbar(image, ax=panels, location="top", label=label, aspect=35)
        colors = ListedColormap(list(MODE_COLORS.values()))
        panels[3].imshow(chosen, origin="lower", extent=extent, cmap=colors, vmin=-0.5, vmax=2.5)
        nodes, _ = panels[0].get_legend_handles_labels()
        modes = [Patch(facecolor=color, label=mode) for mode, color in MODE_COLORS.items()]
        legend_below(figure, [*nodes, *modes], 3)
        return figure
