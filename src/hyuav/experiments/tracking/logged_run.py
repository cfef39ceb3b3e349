"""What a library is asked to log of a job, whichever library it is."""

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import pandas as pd

from hyuav._support.errors import harmless


class Metric(NamedTuple):
    """How a library that can is to draw a metric, and what it is to keep of it."""

    name: str
    axis: str
    """The metric that it is drawn against."""
    summary: str | None = None
    """Such as "max,last"."""


@dataclass(frozen=True)
class Job:
    """What is logged: a training, an evaluation or a comparison."""

    directory: Path
    """That the library keeps its files in."""
    config: Mapping[str, Any]
    """What was asked for."""
    job_type: str
    memory: Path | None = None
    """Directory that remembers the run's identity, so that the next job goes on with it."""
    metrics: Sequence[Metric] = ()
    models: Sequence[str] = ()
    """Artifacts that the job builds on, with their aliases."""
    first_step: int = 0
    """Whatever was logged from this step on is replaced."""


class LoggedRun(Protocol):
    """One run of a library; it may raise whatever the library raises."""

    @property
    def id(self) -> str | None:
        """By which it can be continued, where there is such a thing."""

    @property
    def kept(self) -> str:
        """The command that shows or sends what has been logged."""

    def scalars(self, values: Mapping[str, float], step: int) -> None:
        """Add numbers to the history."""

    def results(
        self, scalars: Mapping[str, float], tables: Mapping[str, pd.DataFrame], directory: Path
    ) -> None:
        """Log what came of the whole job: numbers, tables, and a directory's figures and report."""

    def model(self, files: Mapping[str, Path], metadata: Mapping[str, Any]) -> None:
        """Keep checkpoints, by alias."""

    def close(self, failed: bool) -> str:
        """End the run, and say in one line where it is to be seen."""

    def abandon(self) -> None:
        """End a run in which something has failed."""


def reason(error: Exception) -> str:
    """The first line of an error, which may be long."""
    first, *_ = str(error).strip().splitlines() or [type(error).__name__]
    return first[:200]


def say(line: str) -> None:
    """Print a line on the standard error."""
    print(harmless(line), file=sys.stderr)
