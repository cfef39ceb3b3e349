"""What a comparison has found so far."""

import json
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from hyuav._support.files import write_durably
from hyuav.experiments.comparison.statistics import (
    LAYOUTS,
    improvements,
    in_cells,
    summarize_algorithms,
    summarize_cells,
)


@dataclass(frozen=True)
class Summary:
    """What is told of the learners that have been trained."""

    results: pd.DataFrame
    """A row for each learner, as :meth:`.shards.Shard.tables` gives them."""
    curves: pd.DataFrame
    """A row for each of its evaluations in training."""
    cells: pd.DataFrame
    algorithms: pd.DataFrame
    layouts: pd.DataFrame
    """As ``algorithms``, on the random layouts alone; empty where there are none."""
    improvements: pd.DataFrame

    @classmethod
    def of(cls, results: pd.DataFrame, curves: pd.DataFrame, threshold: float) -> "Summary":
        """What these learners tell, where the threshold is the share that counts as solved."""
        on_layouts = results[in_cells(results)["scenario"] == LAYOUTS]
        return cls(
            results,
            curves,
            summarize_cells(results, threshold),
            summarize_algorithms(results, threshold),
            summarize_algorithms(on_layouts, threshold),
            improvements(results),
        )

    @property
    def tables(self) -> dict[str, pd.DataFrame]:
        """What is logged, by name."""
        names = ("algorithms", "cells", "results", "layouts", "improvements")
        return {name: getattr(self, name) for name in names}

    def save(self, directory: Path) -> None:
        """Write ``results``, ``curves`` and ``cells`` as Parquet, the rest as ``summary.json``.

        Raises:
            OSError: one of them cannot be written; then an earlier one is still there.
        """
        for name in ("results", "curves", "cells"):
            write_durably(directory / f"{name}.parquet", getattr(self, name).to_parquet())
        content = {
            name: getattr(self, name).to_dict(orient="records")
            for name in ("algorithms", "layouts", "improvements")
        }
        text = json.dumps(content, indent=2)
        write_durably(directory / "summary.json", f"{text}\n".encode())
