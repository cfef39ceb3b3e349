"""The files of a generalist's training: solved scenarios, a checkpoint, weights and progress."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import pandas as pd
import torch
from pydantic import Field
from pydantic.dataclasses import dataclass as pydantic_dataclass
from rich.console import Console

from hyuav._support.files import write_durably
from hyuav._support.parameters import Count, CountOrZero, Parameters, Text, Threads, parameter
from hyuav._support.terminal import make_progress
from hyuav.experiments.chunks import do_missing, ranges
from hyuav.experiments.comparison.processes import Workers
from hyuav.experiments.requests import keep_request
from hyuav.learning.checkpoint import load_checkpoint, save_checkpoint
from hyuav.learning.generalist.lessons import Lesson, Lessons
from hyuav.learning.generalist.pretrained import Generalist
from hyuav.learning.generalist.training import GeneralistParameters, GeneralistTraining, Progress
from hyuav.physics.scenario_families import family

CHUNK = 50
"""Scenarios that are solved together, in one file."""

WORKING = ("output", "workers", "threads", "device", "retries")
"""What changes how the work is done and not what comes of it."""

FAMILY = "one"
"""From which it learns: the scenarios whose optimum is exact."""

CHECKPOINT_FILE, PROGRESS_FILE, WEIGHTS_FILE = "training.pt", "progress.csv", "generalist.npz"


@pydantic_dataclass(frozen=True)
class TrainGeneralist(Parameters):
    """From what a generalist learns, and where it is kept."""

    scenarios: Count = parameter(5000)
    """That are solved for it to learn from."""
    validation: Annotated[int, Field(ge=1, le=10**6)] = parameter(200)
    """That are solved to judge it by."""
    workers: Count = parameter(2)
    retries: CountOrZero = parameter(2)
    device: Text = parameter("cpu")
    threads: Threads = parameter(2)
    output: Text = parameter("runs/generalist")


@dataclass(frozen=True)
class Chunk:
    """Some scenarios of a split, solved once and kept in a file."""

    split: str
    seeds: range
    file: Path

    def solve(self) -> None:
        """Solve each scenario and write the file."""
        torch.set_num_threads(1)
        lessons = [Lesson.of(family(FAMILY, seed, self.split)) for seed in self.seeds]
        save_checkpoint(self.file, "lessons", {"all": [own.state_dict() for own in lessons]})

    def load(self) -> list[Lesson]:
        """What was solved.

        Raises:
            InputError: the file is missing or damaged.
        """
        states = load_checkpoint(self.file, "lessons")["all"]
        return [
            Lesson.from_state(family(FAMILY, seed, self.split), state)
            for seed, state in zip(self.seeds, states, strict=True)
        ]


class GeneralistDirectory:
    """The files of one generalist's training.

    Args:
        path: of the directory, which may hold part of the same training.
        request: all that was asked for.
        options: from what it learns.
        parameters: how it learns.

    Raises:
        InputError: another training is in the directory, or it cannot be written to.
    """

    def __init__(
        self,
        path: Path,
        request: dict[str, object],
        options: TrainGeneralist,
        parameters: GeneralistParameters,
    ) -> None:
        keep_request(path, request, WORKING, "a generalist")
        self.path, self._options, self._parameters = path, options, parameters
        (path / "lessons").mkdir(exist_ok=True)

    def learn(self, console: Console) -> Progress:
        """Solve the scenarios that are not solved yet, then learn what is left to learn."""
        training = GeneralistTraining(
            self._lessons("training", self._options.scenarios, console),
            self._lessons("validation", self._options.validation, console),
            self._parameters,
        )
        told = self._resumed(training)
        with make_progress(console, "steps") as progress:
            task = progress.add_task("steps", total=self._parameters.steps, completed=training.step)
            for own in training.run():
                told.append(own)
                progress.update(task, completed=own.step)
                content = {"training": training.state_dict(), "progress": [*map(tuple, told)]}
                save_checkpoint(self.path / CHECKPOINT_FILE, "generalist", content)
        table = pd.DataFrame(told, columns=Progress._fields)
        write_durably(self.path / PROGRESS_FILE, table.to_csv(index=False).encode())
        Generalist(training.network).save(self.path / WEIGHTS_FILE)
        return told[-1]

    def _resumed(self, training: GeneralistTraining) -> list[Progress]:
        if not (self.path / CHECKPOINT_FILE).exists():
            return []
        content = load_checkpoint(self.path / CHECKPOINT_FILE, "generalist")
        training.load_state_dict(content["training"])
        return [Progress(*own) for own in content["progress"]]

    def _lessons(self, split: str, count: int, console: Console) -> Lessons:
        chunks = [
            Chunk(split, seeds, self._file(split, seeds.start)) for seeds in ranges(0, count, CHUNK)
        ]
        workers = Workers(self._options.workers, self._options.retries)
        do_missing(Chunk.solve, chunks, workers, console, f"{split} scenarios, in {CHUNK}s")
        solved = (lesson for chunk in chunks for lesson in chunk.load())
        return Lessons.of(solved).to(self._options.device)

    def _file(self, split: str, first: int) -> Path:
        return self.path / "lessons" / f"{split}_{first:06}.pt"
