"""The runs below a directory: found, summarised and read, though some are still being written."""

import os
import threading
from collections import OrderedDict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from hyuav._support.errors import InputError, rejection
from hyuav.experiments.evaluation import EVALUATION_FILE, FLIGHTS_FILE
from hyuav.experiments.metrics import GrowingMetrics, last_metrics
from hyuav.experiments.regimes.work import REGIMES_FILE
from hyuav.experiments.run_directory import RunDirectory
from hyuav.viz.data.reading import read_evaluation, readable_config, references_of, unit_of

RUNNING_SECONDS = 120.0
"""A training that wrote nothing for longer counts as stopped."""

STATES = ("running", "finished", "stopped")

_DEEPEST = 6
"""Directories below the root in which runs are looked for, as in comparisons and sweeps."""

_WITHOUT_RUNS = {"checkpoints", "figures", "wandb", "tensorboard", "optima"}

_LONGEST_HEADER = 2**20
"""Bytes; no training writes a longer first line of ``metrics.csv``."""

_ROW_BYTES = 250
"""Of the longest rows of ``metrics.csv``."""

MOST_DRAWN = 40
"""Runs in one figure, whose metrics are kept in memory."""

_PARTIAL = ".partial"
"""Behind the name of a comparison's training while it is not finished."""

Stamp = tuple[int, ...]
"""Modification time in ns and size of each file from which an entry was made."""


@dataclass(frozen=True)
class RunEntry:
    """What the list of runs shows of one."""

    name: str
    """Of its directory, from the root; what is only there until it is finished is left out."""
    scenario: str
    algorithm: str
    schemes: tuple[str, ...]
    """Who chooses the mode, as far as it is known."""
    learners: int
    episode: int
    """The last one that is complete."""
    num_episodes: int | None
    """How many are to come in all; None where the configuration does not say."""
    best: float | None
    """Highest noise-free return of a learner so far."""
    unit: str
    """Of returns; empty where it is not known."""
    begun: float
    """When the training began, in seconds since the epoch."""
    changed: float
    """When something was last written, in seconds since the epoch."""

    def state(self, now: float) -> str:
        """One of :data:`STATES`."""
        if self.num_episodes is not None and self.episode >= self.num_episodes:
            return "finished"
        return "running" if now - self.changed < RUNNING_SECONDS else "stopped"

    def matches(self, words: Iterable[str]) -> bool:
        """Whether each word is part of the name, the scenario, the algorithm or a scheme."""
        text = " ".join((self.name, self.scenario, self.algorithm, *self.schemes)).lower()
        return all(word.lower() in text for word in words)


class RunIndex:
    """The runs below a directory, each read again only when its files change.

    Names come from the page, so every file is opened by :meth:`file` or after it: nothing outside
    of the directory is read, be it by ``..`` or by a symbolic link.

    Args:
        root: the directory; it may be missing, and then has no runs.
    """

    def __init__(self, root: str | Path) -> None:
        self.root = Path(root).resolve()
        self._lock = threading.Lock()
        self._entries: dict[str, tuple[Stamp, RunEntry]] = {}
        self._metrics: OrderedDict[str, GrowingMetrics] = OrderedDict()

    def entries(self) -> list[RunEntry]:
        """All runs, the last begun first."""
        with self._lock:
            found = {}
            for directory, _ in _directories(self.root, {"metrics.csv"}):
                name = self._name(directory)
                try:
                    found[name] = self._entry(name, directory)
                except OSError:  # removed meanwhile
                    continue
            self._entries = found
        return sorted(
            (entry for _, entry in found.values()), key=lambda entry: (-entry.begun, entry.name)
        )

    def evaluations(self) -> list[str]:
        """The names of evaluations that are kept apart from any run, with flights to be played."""
        found = _directories(self.root, {"metrics.csv", FLIGHTS_FILE})
        return sorted(self._name(path) for path, files in found if files == {FLIGHTS_FILE})

    def maps(self) -> list[str]:
        """The names of the maps of regimes that are complete."""
        found = _directories(self.root, {REGIMES_FILE})
        return sorted(self._name(path) for path, _ in found)

    def _name(self, directory: Path) -> str:
        """The same while a training goes on and when its directory has got its final name."""
        final = directory.with_suffix("") if directory.suffix == _PARTIAL else directory
        return (directory if final.exists() else final).relative_to(self.root).as_posix()

    def _entry(self, name: str, directory: Path) -> tuple[Stamp, RunEntry]:
        files = directory / "config.yaml", directory / "metrics.csv"
        states = [file.stat() for file in files if file.is_file() and not file.is_symlink()]
        stamp = tuple(value for state in states for value in (state.st_mtime_ns, state.st_size))
        known = self._entries.get(name)
        if known is not None and known[0] == stamp:
            return known
        written = states[0].st_mtime, states[-1].st_mtime
        config = {} if files[0].is_symlink() else readable_config(directory)
        return stamp, _summarize(name, config, files[1], written)

    def file(self, name: str, *parts: str) -> Path:
        """A file of a run.

        Args:
            name: of the run, from the root.
            parts: of the file's path in the run's directory.

        Raises:
            InputError: it would lie outside of the root, or there is none.
        """
        path = self.root.joinpath(name, *parts)
        try:
            if not self.root.joinpath(name).exists():
                path = self.root.joinpath(f"{name}{_PARTIAL}", *parts)
            inside = path.resolve(strict=True).is_relative_to(self.root)
        except (OSError, ValueError):
            accepted = f"a run below {self.root} with {'/'.join(parts) or 'a directory'}"
            raise InputError(rejection("run", name, accepted)) from None
        if not inside:
            raise InputError(rejection("run", name, f"a path below {self.root}"))
        return path

    def has(self, name: str, *parts: str) -> bool:
        """Whether a run has a file that may be read."""
        try:
            return self.file(name, *parts).is_file()
        except InputError:
            return False

    def run(self, name: str) -> RunDirectory:
        """A run's directory, whose configuration and best checkpoint may be read.

        Raises:
            InputError: it has none that lie below the root.
        """
        self.file(name, "config.yaml")
        self.file(name, "checkpoints", "best.pt")
        return RunDirectory(self.file(name))

    def configuration(self, name: str) -> Mapping[str, Any]:
        """What stands in a run's ``config.yaml``, unchecked; nothing where it cannot be read.

        Raises:
            InputError: it does not lie below the root.
        """
        return readable_config(self.file(name, "config.yaml").parent)

    def evaluation(self, name: str) -> Mapping[str, Any] | None:
        """What stands in a run's ``evaluation.json``; None where there is none.

        Raises:
            InputError: it is damaged or another program's.
        """
        if not self.has(name, EVALUATION_FILE):
            return None
        return read_evaluation(self.file(name, EVALUATION_FILE).parent)

    def references(self, name: str) -> dict[str, float]:
        """What the run's learners are set beside, as :func:`.references_of`.

        Raises:
            InputError: as :meth:`evaluation`.
        """
        evaluation = self.evaluation(name)
        return {} if evaluation is None else references_of(evaluation)

    def metrics(self, name: str) -> pd.DataFrame:
        """A run's metrics as far as they are written.

        Raises:
            InputError: there are none, or they are not those of a training.
        """
        path = self.file(name, "metrics.csv")
        with self._lock:
            growing = self._metrics.setdefault(name, GrowingMetrics(path))
            growing.path = path  # which changes when a comparison's training is finished
            self._metrics.move_to_end(name)
            if len(self._metrics) > MOST_DRAWN:
                self._metrics.popitem(last=False)
            return growing.read()


def _directories(
    directory: Path, names: set[str], depth: int = 0
) -> Iterator[tuple[Path, set[str]]]:
    """Directories with some of the files, and which; no symbolic link is followed."""
    try:
        with os.scandir(directory) as listing:
            members = list(listing)
    except OSError:
        return
    files = {m.name for m in members if m.name in names and m.is_file(follow_symlinks=False)}
    if files:
        yield directory, files
    if depth == _DEEPEST:
        return
    for member in members:
        hidden = member.name.startswith(".") or member.name in _WITHOUT_RUNS
        if not hidden and member.is_dir(follow_symlinks=False):
            yield from _directories(directory / member.name, names, depth + 1)


def _summarize(
    name: str, config: Mapping[str, Any], metrics_file: Path, written: tuple[float, float]
) -> RunEntry:
    learners = config.get("learners")
    learners = learners if isinstance(learners, list) else []
    schemes = [own.get("scheme") for own in learners if isinstance(own, dict)]
    training = config.get("training")
    training = training if isinstance(training, dict) else {}
    every = training.get("evaluation_every")
    every = min(max(every, 1), 1000) if isinstance(every, int) else 10
    rows = last_metrics(metrics_file, _ROW_BYTES * max(len(learners), 1) * (every + 2))
    best = rows.get("best_evaluation", pd.Series(dtype=float)).max()
    planned = training.get("num_episodes")
    return RunEntry(
        name,
        _name(config.get("scenario")),
        _name(config.get("algorithm")),
        tuple(dict.fromkeys(str(scheme)[:40] for scheme in schemes)),
        len(learners),
        0 if rows.empty else int(rows["episode"].max()),
        planned if isinstance(planned, int) else None,
        None if pd.isna(best) else float(best),
        unit_of(config),
        *written,
    )


def _name(values: object) -> str:
    """What a section of the configuration calls itself, cut to what a table has room for."""
    name = values.get("name") if isinstance(values, dict) else None
    return str(name)[:80] if isinstance(name, str) else "unknown"
