"""What is random in the environment: fading and tasks of each slot, layouts of each reset."""

from collections.abc import Sequence
from typing import Any

import torch
from torch import Tensor

from hyuav._support.randomness import GAMMA, derived_seed, polar, splitmix64, uniform
from hyuav.physics.channel import RicianFading
from hyuav.physics.slot import Physics
from hyuav.physics.tasks import Tasks, tasks_at

NUMBERS_AT_ONCE = 2**14
"""Drawn for as many slots as this suffices for, but at least one."""

LAYOUTS = "layouts"
"""What is drawn at a reset; fading and tasks are drawn for each slot."""


class Draws:
    """The random numbers of an environment.

    Fading powers come in rows as :class:`hyuav.physics.channel.LinkRow` has them, ``links`` of
    them. Each number depends on its seed and its place alone: slot, row and link or task. So it
    does not matter how many are drawn at once, and devices differ only in rounding.

    Where there is a seed for each row of the batch's first dimension, a row's numbers depend on its
    own seed alone. So rows of equal seeds fly through the same fading and a row keeps its numbers
    whatever other rows there are.

    Args:
        physics: whose fading and tasks are drawn.
        batch_size: of the helpers flown at once.
        seed: of all numbers, or one for each row.
        layout_size: numbers that decide a layout; 0 where none is drawn.
    """

    def __init__(
        self,
        physics: Physics,
        batch_size: torch.Size,
        seed: int | Sequence[int],
        layout_size: int = 0,
    ) -> None:
        self._physics = physics
        self.rows: Tensor | None = None
        """Which of the distinct seeds each row has; None where one seed is for all."""
        if isinstance(seed, int):
            seeds, inner = [seed], batch_size
        else:
            seeds, inner = list(dict.fromkeys(seed)), batch_size[1:]
            self.rows = self._tensor([seeds.index(own) for own in seed])
        self._rank = 1 + len(inner)
        widths = {"fading": physics.link_row.size, "tasks": 2 * physics.scenario.num_ues}
        if layout_size:
            widths[LAYOUTS] = layout_size
        self._names, device = tuple(widths), physics.device
        keys = [[derived_seed(own, name) for own in seeds] for name in self._names]
        self._keys = self._tensor(keys).reshape(len(keys), len(seeds), *(1 for _ in inner))
        per_slot = len(seeds) * inner.numel() * widths["fading"]
        self._at_once = max(NUMBERS_AT_ONCE // per_slot, 1)
        self._places = {}
        for name, width in widths.items():
            columns = torch.arange(1, width + 1, device=device).reshape(-1, *(1,) * self._rank)
            helpers = torch.arange(inner.numel(), device=device).reshape(inner)
            self._places[name] = columns * GAMMA, helpers * width * GAMMA, inner.numel() * width
        trailing = (1,) * self._rank
        self._law = RicianFading.of(physics.k_factor.reshape(-1, *trailing))
        # A tensor, so that a graph that torch.compile makes of a slot counts on; where a GPU need
        # not be waited for.
        self._slots = torch.zeros(len(self._names), dtype=torch.int64, device="cpu")
        self._blocks: dict[str, tuple[int, tuple[Tensor, ...]]] = {}

    def _tensor(self, values: object) -> Tensor:
        return torch.tensor(values, device=self._physics.device)

    def fading(self) -> Tensor | None:
        """The next slot's fading powers: (*batch_size, links), or None where fading is off."""
        return self._spread(self._next("fading")) if self._physics.scenario.fading else None

    def tasks(self) -> Tasks:
        """The next slot's tasks, each (*batch_size, U)."""
        return self._as_tasks(self._spread(self._next("tasks")))

    def layouts(self) -> Tensor:
        """What decides the layouts of the episodes that begin: (*batch_size, layout_size)."""
        return self._spread(self._take(LAYOUTS, 1))[0]

    def take_fading(self, count: int) -> Tensor | None:
        """The fading of the next ``count`` slots: (count, *batch_size, links)."""
        return self._spread(self._take("fading", count)) if self._physics.scenario.fading else None

    def take_tasks(self, count: int) -> Tensor:
        """The tasks of the next ``count`` slots: (count, rows, 2, ..., U), sizes and cycles."""
        levels = self._spread(self._take("tasks", count))
        return torch.stack(self._as_tasks(levels), dim=2)

    def ticket(self, *, tasks: bool) -> tuple[Tensor, Tensor]:
        """What decides the next slot's fading and, if wanted, tasks; it counts as drawn."""
        slots = self._slots.to(self._keys.device, copy=True)
        for name, drawn in (("fading", self._physics.scenario.fading), ("tasks", tasks)):
            self._count(name, int(drawn))
        return self._keys, slots

    def redeem(self, keys: Tensor, slots: Tensor) -> tuple[Tensor | None, Tasks]:
        """The fading and tasks of a ticket, by tensor operations that a graph can record."""
        fading = None
        if self._physics.scenario.fading:
            fading = self._spread(self._numbers("fading", keys[0], slots[0]))
        return fading, self._as_tasks(self._spread(self._numbers("tasks", keys[1], slots[1])))

    def state(self) -> dict[str, Any]:
        """Where the random numbers stand, for :meth:`set_state`."""
        slots = dict(zip(self._names, self._slots.tolist(), strict=True))
        return {"keys": self._keys.cpu(), **slots}

    def set_state(self, state: dict[str, Any]) -> None:
        """Continue where :meth:`state` was taken from draws of as many distinct seeds."""
        self._keys = state["keys"].to(self._keys.device).reshape(self._keys.shape)
        self._slots = torch.tensor([int(state[name]) for name in self._names], device="cpu")
        self._blocks.clear()

    def _spread(self, numbers: Tensor) -> Tensor:
        """From what :meth:`_numbers` gives to the batch's (..., *batch_size, k)."""
        if self.rows is None:
            return numbers
        axis = numbers.ndim - 1 - self._rank
        seeds, rows = numbers.shape[axis], len(self.rows)
        if seeds == rows:
            return numbers
        if seeds == 1:  # the same memory for all rows
            return numbers.expand(*numbers.shape[:axis], rows, *numbers.shape[axis + 1 :])
        return numbers.index_select(axis, self.rows)

    def _next(self, name: str) -> Tensor:
        """The next slot's numbers, several slots of which are drawn at once, but in a graph."""
        if torch.compiler.is_compiling():
            number = self._names.index(name)
            numbers = self._numbers(name, self._keys[number], self._slots[number]).contiguous()
            self._slots[number] += 1
            return numbers  # as they are without a graph, or there would be two
        block, place = divmod(self._count(name, 1), self._at_once)
        drawn, slots = self._blocks.get(name, (-1, ()))
        if drawn != block:
            slots = self._of_slots(name, block * self._at_once, self._at_once).unbind()
            self._blocks[name] = block, slots
        return slots[place]

    def _take(self, name: str, count: int) -> Tensor:
        return self._of_slots(name, self._count(name, count), count)

    def _count(self, name: str, slots: int) -> int:
        """Count slots as drawn, and tell how many were before."""
        counts, number = self._slots.numpy(), self._names.index(name)  # faster than the tensor
        drawn = int(counts[number])
        counts[number] += slots
        return drawn

    def _of_slots(self, name: str, first: int, count: int) -> Tensor:
        slots = torch.arange(first, first + count, device=self._keys.device)
        slots = slots.reshape(-1, 1, *(1,) * self._rank)
        return self._numbers(name, self._keys[self._names.index(name)], slots).contiguous()

    def _numbers(self, name: str, keys: Tensor, slots: Tensor) -> Tensor:
        """Fading powers or uniform numbers (..., D, *inner, width) of slots (..., 1, *1).

        The axis of D seeds is left out where one is for all rows. The helpers are the last
        dimension until the end: a long loop for a compiler.
        """
        column, helper, per_slot = self._places[name]
        bits = splitmix64(helper + (keys + slots * per_slot * GAMMA) + column)
        if name == "fading":
            numbers = self._law.power(*polar(bits, self._physics.dtype))
        else:
            numbers = uniform(bits).to(self._physics.dtype)
        numbers = numbers.movedim(-1 - self._rank, -1)
        return numbers.squeeze(-1 - self._rank) if self.rows is None else numbers

    def _as_tasks(self, levels: Tensor) -> Tasks:
        return tasks_at(self._physics.scenario, *levels.chunk(2, dim=-1))


class GivenDraws:
    """One slot's fading and tasks, for an environment whose slot is recorded.

    Args:
        fading: powers (*batch_size, links), or None where fading is off.
        tasks: of the slot, or None where none are needed.
    """

    def __init__(self, fading: Tensor | None, tasks: Tasks | None) -> None:
        self._fading, self._tasks = fading, tasks

    def fading(self) -> Tensor | None:
        """The slot's fading."""
        return self._fading

    def tasks(self) -> Tasks:
        """The slot's tasks."""
        assert self._tasks is not None
        return self._tasks
