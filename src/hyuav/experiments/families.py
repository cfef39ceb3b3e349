"""How the generalist flies in whole families of scenarios, beside the optimum of each."""

import warnings
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Annotated, Any

import pandas as pd
import torch
from pydantic import Field
from pydantic.dataclasses import dataclass as pydantic_dataclass
from rich.console import Console

from hyuav._support.errors import ScenarioWarning
from hyuav._support.files import write_durably
from hyuav._support.parameters import (
    Count,
    CountOrZero,
    OneOf,
    Parameters,
    PositiveNumber,
    Text,
    parameter,
)
from hyuav.experiments.chunks import do_missing, ranges
from hyuav.experiments.comparison.processes import Workers
from hyuav.experiments.evaluation import EvaluationParameters, fly
from hyuav.experiments.requests import keep_request
from hyuav.experiments.schemes import GENERALISTS
from hyuav.learning.generalist.pretrained import pretrained
from hyuav.learning.generalist.refine import refined
from hyuav.physics.scenario_families import FAMILIES, SPLITS, family
from hyuav.references.flight import FlightPolicy
from hyuav.references.optimum import solve_optimum

CHUNK = 5
"""Scenarios that are flown together, in one file."""

LEAST = 1.0
"""bps/Hz that the optimum must bring, or a scenario is left out."""

POWER_STEP, POWER_STEP_OF_SEVERAL = 1.0, 5.0
"""In dB, between the levels of power that the optimum chooses from: of one helper, of several."""

DRAWS, DRAWS_OF_SEVERAL = 16, 4
"""Of fading, over which the optimum's expected reward is averaged."""

WORKING = ("output", "workers", "retries", "drawn")
"""What changes how the work is done and not what comes of it."""

MOST_VALUES = 6
"""Of a column, which are told one by one."""

TABLE_FILE = "families.csv"


@pydantic_dataclass(frozen=True)
class Families(Parameters):
    """Which scenarios are flown, and how exactly."""

    family: Annotated[str, OneOf(*FAMILIES)] = parameter("one")
    split: Annotated[str, OneOf(*SPLITS)] = parameter("test")
    scenarios: Count = parameter(300)
    first: CountOrZero = parameter(0)
    """The seed of the first scenario."""
    episodes: Annotated[int, Field(ge=2, le=10**6)] = parameter(100)
    """Of fading, the same for all that fly a scenario."""
    resolution: PositiveNumber = parameter(2.0, unit="m")
    """Of the optimum's grid."""
    drawn: CountOrZero = parameter(3)
    """Of the scenarios in which most is lost, how many flights are drawn."""
    workers: Count = parameter(2)
    retries: CountOrZero = parameter(2)
    output: Text = parameter("runs/families")


@dataclass(frozen=True)
class Chunk:
    """Some scenarios of a family, flown once and kept in a file."""

    seeds: range
    options: Families
    file: Path

    def fly(self) -> None:
        """Fly each scenario and write the file."""
        torch.set_num_threads(1)
        warnings.simplefilter("ignore", ScenarioWarning)  # some bring nothing, and are counted
        rows = [flown(seed, self.options) for seed in self.seeds]
        write_durably(self.file, pd.DataFrame(rows).to_parquet())


def flown(seed: int, options: Families) -> dict[str, Any]:
    """What the generalist, refined too, and the optimum earn in a scenario, as a row."""
    scenario, rule = family(options.family, seed, options.split)
    parameters = EvaluationParameters(episodes=options.episodes, flights=1, seed=seed)
    begun = perf_counter()
    policy = pretrained("generalist").policy(scenario, rule)
    plan = policy.plan()
    planned = perf_counter()
    better = refined(policy)
    seconds = planned - begun, perf_counter() - planned
    several = scenario.num_helpers > 1
    best = solve_optimum(
        scenario,
        [rule],
        resolution=options.resolution,
        power_step=POWER_STEP_OF_SEVERAL if several else POWER_STEP,
        draws=DRAWS_OF_SEVERAL if several else DRAWS,
        evaluation_draws=2,
        certify=False,
    )[rule]
    policies = {
        "generalist": FlightPolicy(plan.path, scenario, plan.share),
        "refined": better,
        "optimum": best.policy,
    }
    earned = {
        name: float(fly(scenario, GENERALISTS[rule], own, parameters).earned.mean())
        for name, own in policies.items()
    }
    return {
        "family": options.family,
        "seed": seed,
        "mode_rule": rule,
        "num_ues": scenario.num_ues,
        "num_slots": scenario.num_slots,
        "power_control": scenario.power_control,
        "num_helpers": scenario.num_helpers,
        **earned,
        "seconds": seconds[0],
        "seconds_refining": seconds[1],
    }


class FamiliesDirectory:
    """The files of one evaluation: ``flown/`` and, of all scenarios, ``families.csv``.

    Args:
        path: of the directory, which may hold part of the same evaluation.
        request: all that was asked for.
        options: which scenarios are flown.

    Raises:
        InputError: another evaluation is in the directory, or it cannot be written to.
    """

    def __init__(self, path: Path, request: dict[str, object], options: Families) -> None:
        keep_request(path, request, WORKING, "an evaluation of a family")
        self.path, self._options = path, options
        (path / "flown").mkdir(exist_ok=True)

    def complete(self, console: Console) -> pd.DataFrame:
        """Fly what is not flown yet; a row for each scenario."""
        options = self._options
        chunks = [
            Chunk(seeds, options, self.path / "flown" / f"{seeds.start:06}.parquet")
            for seeds in ranges(options.first, options.scenarios, CHUNK)
        ]
        workers = Workers(options.workers, options.retries)
        do_missing(Chunk.fly, chunks, workers, console, f"scenarios, in {CHUNK}s")
        table = pd.concat([pd.read_parquet(chunk.file) for chunk in chunks], ignore_index=True)
        write_durably(self.path / TABLE_FILE, table.to_csv(index=False).encode())
        return table


def fractions(table: pd.DataFrame) -> pd.DataFrame:
    """The scenarios in which there is something to earn, with fractions of the optimum."""
    own = table[table["optimum"] >= LEAST].copy()
    for name in ("generalist", "refined"):
        own[f"{name}_fraction"] = own[name] / own["optimum"]
    return own


def _binned(values: pd.Series) -> pd.Series:
    """Values as they are, or the quarter of their range in which they lie, as FROM-TO."""
    if values.nunique() <= MOST_VALUES:
        return values.astype(str)
    quarters = pd.cut(values, 4, include_lowest=True)
    spans = values.groupby(quarters, observed=True).agg(["min", "max"])
    names = {quarter: f"{own['min']:2d}-{own['max']:2d}" for quarter, own in spans.iterrows()}
    return quarters.map(names)


def distribution(own: pd.DataFrame, by: str | None = None) -> pd.DataFrame:
    """Mean, 5th percentile and worst of the fractions, of all or by a column.

    Args:
        own: what :func:`fractions` gives.
        by: a column; numbers of users and slots are put into bins.
    """
    if by is None:
        groups = [("all", own)]
    else:
        groups = [(str(key), part) for key, part in own.groupby(_binned(own[by]), observed=True)]
    rows = []
    for key, part in groups:
        row: dict[str, Any] = {"value": key, "scenarios": len(part)}
        for name in ("generalist", "refined"):
            fraction = part[f"{name}_fraction"]
            row |= {
                f"{name}_mean": fraction.mean(),
                f"{name}_p5": fraction.quantile(0.05),
                f"{name}_worst": fraction.min(),
            }
        rows.append(row)
    return pd.DataFrame(rows)
