"""What is random in the environment: one draw of fading and tasks for each slot."""

from collections.abc import Sequence
from typing import Any, Protocol

import torch
from torch import Tensor

from hyuav.randomness import RowStream
from hyuav.system import SecureOffloadingSystem, Tasks


class Draws(Protocol):
    """Where an environment takes its random numbers from."""

    def fading(self) -> Tensor | None:
        """The next slot's fading powers: (*batch_size, 3 U + 2), or None where fading is off."""

    def tasks(self) -> Tasks:
        """The next slot's tasks, each (*batch_size, U)."""

    def state(self) -> dict[str, Any]:
        """Where the random numbers stand, for :meth:`set_state`."""

    def set_state(self, state: dict[str, Any]) -> None:
        """Continue where :meth:`state` was taken."""


class BatchDraws:
    """One seed for the whole batch.

    Args:
        system: whose fading and tasks are drawn.
        batch_size: of the helpers flown at once.
        seed: of all numbers.
    """

    def __init__(self, system: SecureOffloadingSystem, batch_size: torch.Size, seed: int) -> None:
        self._system, self._batch_size = system, batch_size
        root = torch.Generator().manual_seed(seed)
        seeds = torch.randint(2**62, (2,), generator=root).tolist()
        self._fading, self._tasks = (
            torch.Generator(system.device).manual_seed(each) for each in seeds
        )

    def fading(self) -> Tensor | None:
        """See :meth:`Draws.fading`."""
        return self._system.draw_fading(self._batch_size, self._fading)

    def tasks(self) -> Tasks:
        """See :meth:`Draws.tasks`."""
        return self._system.draw_tasks(self._batch_size, self._tasks)

    def state(self) -> dict[str, Any]:
        """See :meth:`Draws.state`."""
        return {"fading": self._fading.get_state(), "tasks": self._tasks.get_state()}

    def set_state(self, state: dict[str, Any]) -> None:
        """See :meth:`Draws.set_state`."""
        self._fading.set_state(state["fading"])
        self._tasks.set_state(state["tasks"])


class RowDraws:
    """A seed for each row of the batch's first dimension.

    A row's numbers depend on its own seed alone, so rows of equal seeds fly through the same
    fading and a row keeps its numbers whatever other rows there are.

    Args:
        system: whose fading and tasks are drawn; on the CPU, whatever the device.
        batch_size: of the helpers flown at once, of at least one dimension.
        seeds: of the rows.
    """

    def __init__(
        self, system: SecureOffloadingSystem, batch_size: torch.Size, seeds: Sequence[int]
    ) -> None:
        on_cpu = SecureOffloadingSystem(system.scenario, "cpu", system.dtype)
        inner = batch_size[1:]

        def fading(count: int, generator: torch.Generator) -> Tensor:
            powers = on_cpu.draw_fading((count, *inner), generator)
            return torch.empty(count, 0) if powers is None else powers

        def tasks(count: int, generator: torch.Generator) -> Tensor:
            return torch.stack(on_cpu.draw_tasks((count, *inner), generator), dim=1)

        self._faded = system.scenario.fading
        self._streams = {
            "fading": RowStream(fading, seeds, "fading", system.device),
            "tasks": RowStream(tasks, seeds, "tasks", system.device),
        }

    def fading(self) -> Tensor | None:
        """See :meth:`Draws.fading`."""
        return next(self._streams["fading"]) if self._faded else None

    def tasks(self) -> Tasks:
        """See :meth:`Draws.tasks`."""
        return Tasks(*next(self._streams["tasks"]).unbind(dim=1))

    def take_fading(self, count: int) -> Tensor | None:
        """The fading of the next ``count`` slots: (count, *batch_size, 3 U + 2)."""
        return self._streams["fading"].take(count) if self._faded else None

    def take_tasks(self, count: int) -> Tensor:
        """The tasks of the next ``count`` slots: (count, rows, 2, ..., U), sizes and cycles."""
        return self._streams["tasks"].take(count)

    def state(self) -> dict[str, Any]:
        """See :meth:`Draws.state`."""
        return {name: stream.state() for name, stream in self._streams.items()}

    def set_state(self, state: dict[str, Any]) -> None:
        """See :meth:`Draws.set_state`."""
        for name, stream in self._streams.items():
            stream.set_state(state[name])
