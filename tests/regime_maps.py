"""A map of regimes that is written at will, with a point of each kind."""

from pathlib import Path

import pandas as pd
from omegaconf import OmegaConf

from hyuav import Scenario
from hyuav.experiments.regimes.plan import Axes, Axis
from hyuav.experiments.regimes.work import REGIMES_FILE, SCHEMES

AXES = Axes(
    Axis("jamming_power", 1e-3, 0.1, 3), Axis("eavesdropper_distance", 40.0, 80.0, 2, "linear")
)

VALUES = (
    (30.0, 1.0, 10.0, 10.0, 60.0),  # no helper is best
    (5.0, 20.0, 10.0, 20.1, 40.0),  # relaying, as near to the hybrid scheme as makes no matter
    (0.0, 0.0, 8.0, 8.0, 8.0),  # only jamming brings anything
    (2.0, 6.0, 5.0, 9.0, 9.0),  # hybrid
    (0.0, 0.0, 0.0, 0.0, 0.0),  # nothing does
    (0.0, 0.0, 0.0, 0.0, 3.0),  # power control alone
)
"""Of :data:`SCHEMES` in bps/Hz at each point, x by x and then y by y."""

BEST = ["no_helper", "relay", "jamming", "hybrid", "nothing", "nothing"]


def write_map(directory: Path, **changes: object) -> Path:
    """The files of the map, over the preset ``two_clusters``.

    Args:
        directory: to be made.
        changes: fields of the scenario.
    """
    fields = {"name": "two_clusters", **Scenario.preset("two_clusters").to_dict(), **changes}
    directory.mkdir(parents=True)
    OmegaConf.save({**AXES.to_dict(), "scenario": fields}, directory / "config.yaml")
    points = [(x, y) for y in AXES.y.values for x in AXES.x.values]
    rows = [(*point, *values) for point, values in zip(points, VALUES, strict=True)]
    columns = [AXES.x.field, AXES.y.field, *SCHEMES]
    pd.DataFrame(rows, columns=columns).to_csv(directory / REGIMES_FILE, index=False)
    return directory
