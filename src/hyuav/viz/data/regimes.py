"""Which scheme is best at each point of a map of regimes, and by how much."""

import io
import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from hyuav._support.errors import InputError, one_line, rejection
from hyuav._support.files import read_regular
from hyuav._support.formatting import in_words
from hyuav._support.yaml_files import read_yaml
from hyuav.experiments.regimes.plan import Axes, Axis
from hyuav.experiments.regimes.work import LINES, REGIMES_FILE, SCHEMES
from hyuav.experiments.scenarios import named_scenario
from hyuav.physics.scenario import Scenario
from hyuav.viz.data.schemes import COLORS, scheme_color

NOTHING = "nothing"
"""The regime in which no scheme brings anything."""

FIXED = tuple(name for name in SCHEMES if name != "power_control")
"""Schemes at fixed power, from the simplest on."""

REGIMES = (*FIXED, NOTHING)
"""What can be best."""

NEAR = 0.01
"""The simplest scheme counts as the best that comes so near to the best, as a share of it."""

STEPS = (1.1, 1.5, 3.0)
"""Between the shades: how many times as much as the best of the others the best scheme brings."""

SHADES = (
    "The fuller a color, the more it brings: below and above "
    f"{', '.join(f'{step:g}' for step in STEPS)} times the others."
)
"""What the shades tell."""

GAIN_LEVELS = (1.05, 1.1, 1.2, 1.4, 1.7, 2.2, 3.0, 5.0, 10.0, 20.0, 50.0, 100.0)
"""Between the colors of the gain: many times as much as the best at fixed power."""

LABELS = {
    "no_helper": "No helper",
    "relay": "Relaying",
    "jamming": "Jamming",
    "hybrid": "Hybrid",
    "power_control": "Hybrid with power control",
    NOTHING: "Nothing is secret",
}

REGIME_COLORS = {
    "no_helper": scheme_color("no_helper"),
    "relay": COLORS["re_ot"],
    "jamming": COLORS["ja_ot"],
    "hybrid": COLORS["proposed"],
    NOTHING: "#FFFFFF",
}


class RegimeMap(NamedTuple):
    """What a map of regimes shows."""

    name: str
    """Of its scenario."""
    axes: Axes
    rows: pd.DataFrame
    """For each point, x by x and then y by y: both parameters; the secrecy sum-rate of each of
    :data:`SCHEMES` in bps/Hz; ``best``, one of :data:`REGIMES`; ``factor``, how many times as much
    as the best of the others at fixed power it brings, where the hybrid scheme, which holds them,
    counts as another only to no helper; and ``gain``, how many times as much as it the hybrid
    scheme with power control brings. Infinite where the others bring nothing."""
    own: tuple[float, float]
    """What the scenario itself has of both parameters."""
    own_label: str

    def grid(self, column: str) -> NDArray[Any]:
        """A column with a row per y and a column per x."""
        return self.rows[column].to_numpy().reshape(self.axes.y.points, self.axes.x.points)

    @property
    def present(self) -> list[str]:
        """The regimes that there are, in the order of :data:`REGIMES`."""
        return [name for name in REGIMES if (self.rows["best"] == name).any()]

    @property
    def shades(self) -> NDArray[np.int64]:
        """Where ``factor`` stands between :data:`STEPS`, from 0 on, as :meth:`grid` has it."""
        return np.digitize(np.nan_to_num(self.grid("factor"), posinf=np.inf), STEPS)


def is_map(directory: Path) -> bool:
    """Whether a directory holds a map of regimes, however much of it is there yet."""
    return (directory / LINES).is_dir() or (directory / REGIMES_FILE).is_file()


def read_regimes(directory: Path) -> RegimeMap:
    """What the directory of a map holds.

    Raises:
        InputError: a file is missing, damaged or another program's.
    """
    config = read_yaml(directory / "config.yaml")
    axes = Axes.from_dict({name: own for name, own in config.items() if name in ("x", "y")})
    name, scenario = named_scenario(config.get("scenario"))
    rows = _read(directory / REGIMES_FILE, axes)
    own = axes.x.quantity.of(scenario), axes.y.quantity.of(scenario)
    paper = Scenario(
        ue_positions=scenario.ue_positions, num_slots=scenario.num_slots, fading=scenario.fading
    )
    label = "the paper's values" if scenario == paper else "the scenario's own values"
    return RegimeMap(name, axes, judged(rows), own, label)


def _read(file: Path, axes: Axes) -> pd.DataFrame:
    columns = [axes.x.field, axes.y.field, *SCHEMES]
    points = axes.x.points * axes.y.points
    accepted = f"the table of a map of regimes with {points} points (`hyuav regimes` makes it)"
    try:
        rows = pd.read_csv(io.BytesIO(read_regular(file)))[columns].astype(float)
    except (OSError, ValueError, LookupError) as error:
        raise InputError(f"{file}: expected {accepted} ({one_line(str(error))[:200]})") from None
    if len(rows) != points or not np.isfinite(rows.to_numpy()).all():
        raise InputError(rejection("regimes", str(file), accepted))
    return rows


def judged(rows: pd.DataFrame) -> pd.DataFrame:
    """The points with ``best``, ``factor`` and ``gain``, as :class:`RegimeMap` tells them.

    Args:
        rows: with the sum-rate of each of :data:`SCHEMES` at each point.
    """
    alone, relay, jamming, _ = (rows[name] for name in FIXED)
    top = rows[list(FIXED)].max(axis=1)
    near = rows[list(FIXED)].ge((1.0 - NEAR) * top, axis=0)
    best = near.idxmax(axis=1).where(top > 0, NOTHING)
    others = pd.DataFrame(
        {
            "no_helper": rows[["relay", "jamming", "hybrid"]].max(axis=1),
            "relay": np.maximum(alone, jamming),
            "jamming": np.maximum(alone, relay),
            "hybrid": rows[["no_helper", "relay", "jamming"]].max(axis=1),
            NOTHING: 0.0,
        }
    )
    number = best.map(list(others.columns).index).to_numpy()
    other = others.to_numpy()[np.arange(len(rows)), number]
    with np.errstate(divide="ignore", invalid="ignore"):
        factor, gain = top.to_numpy() / other, rows["power_control"].to_numpy() / top.to_numpy()
    return rows.assign(best=best, factor=factor, gain=gain)


def axis_label(axis: Axis) -> str:
    """What is swept, in words with its unit."""
    if axis.field == "ue_spread":
        return "Distances of the UEs from L (times the scenario's)"
    if axis.field == "eavesdropper_distance":
        return "Distance of the eavesdropper from L (m)"
    return in_words(axis.field, axis.quantity.unit)


def edges(axis: Axis) -> NDArray[np.float64]:
    """Where the cells around the values of an axis end, one more than there are values."""
    is_log = axis.scale == "log"
    values = np.log(axis.values) if is_log else np.array(axis.values)
    between = (values[1:] + values[:-1]) / 2
    first, last = 2 * values[0] - between[0], 2 * values[-1] - between[-1]
    ends = np.concatenate([[first], between, [last]])
    return np.exp(ends) if is_log else ends


def shade(color: str, number: int) -> str:
    """A regime's color, the stronger the more its scheme is better: ``#RRGGBB``.

    Args:
        color: of the regime.
        number: of the shade, from 0 to the number of :data:`STEPS`.
    """
    share = 0.3 + 0.7 * number / len(STEPS)
    channels = (int(color[start : start + 2], 16) for start in (1, 3, 5))
    return "#" + "".join(f"{round(255 - share * (255 - own)):02X}" for own in channels)


def times(factor: float) -> str:
    """How many times as much; "-" where there is nothing, and a sign where only one brings any."""
    if math.isnan(factor):
        return "-"
    return f"{factor:.2f}" if math.isfinite(factor) else "∞"


def shares_table(found: RegimeMap) -> pd.DataFrame:
    """For each regime that there is: ``best``, its share of the points, its largest factor."""
    rows = [
        {
            "best": name,
            "share": float((found.rows["best"] == name).mean()),
            "factor": float(found.rows.loc[found.rows["best"] == name, "factor"].max()),
        }
        for name in found.present
    ]
    return pd.DataFrame(rows)
