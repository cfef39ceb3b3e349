"""Maps of the secrecy sum-rate over the helper's position."""

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from hyuav.envs.rendering import OKABE_ITO, draw_scenario
from hyuav.physics.scenario import Scenario
from hyuav.viz.data.maps import sum_rates_over_map
from hyuav.viz.paper.style import COLUMN_WIDTH, STYLE

MODE_COLORS = {
    "neither": "0.88",
    "jamming": OKABE_ITO["reddish purple"],
    "relay": OKABE_ITO["yellow"],
}
"""Where no mode earns anything, and the modes, in the order of the map's values.

None is the color of a scheme or of a node.
"""


def sum_rate_table(scenario: Scenario, resolution: float = 1.0) -> pd.DataFrame:
    """The secrecy sum-rate at every helper position.

    Without fading; where the UEs can fill the edge server, with tasks of mean size.

    Args:
        scenario: whose map it is.
        resolution: of the map in m.

    Returns:
        row by row from the south-west, ``x`` and ``y`` in m, and in bps/Hz the sum-rates in
        ``relay`` and in ``jamming``, and the ``better`` of both.
    """
    over = sum_rates_over_map(scenario, resolution)
    x, y = np.meshgrid(over.axis, over.axis)
    rates = {"relay": over.relay, "jamming": over.jamming, "better": over.better}
    columns = {"x": x, "y": y, **rates}
    return pd.DataFrame({name: values.ravel() for name, values in columns.items()})


def sum_rate_maps(scenario: Scenario, table: pd.DataFrame) -> Figure:
    """The secrecy sum-rate in relay, in jamming and in the better mode, and which one that is.

    Args:
        scenario: whose map is drawn.
        table: of :func:`sum_rate_table`.
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
        figure.colorbar(
            image, ax=panels, location="top", label="Secrecy sum-rate (bps/Hz)", aspect=35
        )
        colors = ListedColormap(list(MODE_COLORS.values()))
        panels[3].imshow(chosen, origin="lower", extent=extent, cmap=colors, vmin=-0.5, vmax=2.5)
        nodes, _ = panels[0].get_legend_handles_labels()
        modes = [Patch(facecolor=color, label=mode) for mode, color in MODE_COLORS.items()]
        figure.legend(
            handles=[*nodes, *modes],
            loc="outside lower center",
            ncols=3,
            frameon=False,
            columnspacing=1.0,
        )
        return figure
