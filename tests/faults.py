"""Real faults: disks that are full or read-only, and losses that are no longer finite.

A small disk is mounted where the system allows it.
"""

import contextlib
import itertools
import resource
import subprocess
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from rich.console import Console

from hyuav.experiments.run_directory import RunConfiguration, RunDirectory
from hyuav.experiments.tracking import LoggerParameters, Tracker

MEGABYTE = 2**20


class Disk:
    """A directory whose disk can run full or become read-only.

    Args:
        path: of the directory.
        mounted: whether it is a disk of its own. If not, the process is not allowed to write more,
            and the directories' permissions are taken away.
    """

    def __init__(self, path: Path, *, mounted: bool) -> None:
        self.path, self._mounted = path, mounted

    @contextmanager
    def full(self) -> Iterator[None]:
        """Nothing more can be written meanwhile."""
        if not self._mounted:
            with _no_file_may_grow():
                yield
            return
        filler = self.path / "filler"
        with filler.open("wb", buffering=0) as file:
            for size in (MEGABYTE, 4096, 1):
                with contextlib.suppress(OSError):
                    while file.write(b"\0" * size):
                        pass
        try:
            yield
        finally:
            filler.unlink()

    @contextmanager
    def read_only(self) -> Iterator[None]:
        """Nothing can be changed meanwhile."""
        self._allow(writing=False)
        try:
            yield
        finally:
            self._allow(writing=True)

    def _allow(self, *, writing: bool) -> None:
        if self._mounted:
            mode = "rw" if writing else "ro"
            subprocess.run(["mount", "-o", f"remount,{mode}", str(self.path)], check=True)
            return
        for path in (self.path, *self.path.rglob("*")):
            path.chmod((0o755 if path.is_dir() else 0o644) - (0 if writing else 0o200))


@contextmanager
def small_disk(path: Path, megabytes: int = 16) -> Iterator[Disk]:
    """A disk of few megabytes at ``path``."""
    path.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", f"size={megabytes}m", "tmpfs", str(path)]
    try:
        mounted = subprocess.run(command, capture_output=True, check=False).returncode == 0
    except FileNotFoundError:
        mounted = False
    try:
        yield Disk(path, mounted=mounted)
    finally:
        if mounted:
            subprocess.run(["umount", str(path)], check=True)


@contextmanager
def _no_file_may_grow() -> Iterator[None]:
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def leave_overflowing(
    directory: Path, configuration: RunConfiguration, flown: int, learners: Sequence[int]
) -> None:
    """An interrupted training in which the squares of some critics' losses will be beyond a float.

    Args:
        directory: of the training.
        configuration: of the training, in one cohort.
        flown: episodes before it was interrupted.
        learners: whose critics they are.
    """
    training = configuration.new_training()
    run = RunDirectory.create(directory, configuration)
    silent = LoggerParameters(mode="disabled"), Console(quiet=True)
    with Tracker(run, configuration, training, *silent) as tracker:
        for episode in itertools.islice(training.episodes(), flown):
            tracker.log(episode)
        (cohort,) = training.cohorts
        for name, values in cohort.algorithm.loss.state_dict().items():
            if "value_network" in name:
                for learner in learners:
                    values.select(-min(values.ndim, 3), learner).mul_(1e25)
        tracker.save()
