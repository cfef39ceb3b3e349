"""Random numbers that belong to one row of a batch, whatever other rows there are."""

import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Self

import numpy as np
import torch
from torch import Tensor
from torch.overrides import TorchFunctionMode

BLOCK = 64
"""Draws made at once for each row."""


def derived_generator(seed: int, purpose: str) -> torch.Generator:
    """A generator for one purpose; those of other seeds or purposes are independent of it."""
    entropy = np.random.SeedSequence([seed, zlib.crc32(purpose.encode())])
    return torch.Generator().manual_seed(int(entropy.generate_state(1, np.uint64)[0] >> 1))


class RowStream:
    """Random tensors, one after another, in which each row is drawn from its own seed.

    Rows of equal seeds are equal. Numbers are drawn on the CPU in blocks, so that they are the
    same on every device and cost no loop over the rows in most calls.

    Args:
        draw: makes ``count`` draws (count, *shape) with a generator.
        seeds: of the rows.
        purpose: what the numbers are for; streams of other purposes are independent.
        device: of the tensors.
    """

    def __init__(
        self,
        draw: Callable[[int, torch.Generator], Tensor],
        seeds: Sequence[int],
        purpose: str,
        device: torch.device,
    ) -> None:
        self._draw, self._device = draw, device
        distinct = list(dict.fromkeys(seeds))
        self._generators = [derived_generator(seed, purpose) for seed in distinct]
        self._rows: list[int] | None = None
        if len(distinct) < len(seeds):
            self._rows = [distinct.index(seed) for seed in seeds]
        self._refill()

    def _refill(self) -> None:
        self._before = [generator.get_state() for generator in self._generators]
        draws = [self._draw(BLOCK, generator) for generator in self._generators]
        self._block = torch.stack(draws, dim=1).to(self._device)
        self._used = 0

    def __iter__(self) -> Self:
        return self

    def __next__(self) -> Tensor:
        """The next draw: (rows, *shape)."""
        return self.take(1)[0]

    def take(self, count: int) -> Tensor:
        """The next ``count`` draws: (count, rows, *shape)."""
        parts = []
        while count:
            if self._used == BLOCK:
                self._refill()
            part = self._block[self._used : self._used + count]
            self._used += len(part)
            count -= len(part)
            parts.append(part)
        draws = parts[0] if len(parts) == 1 else torch.cat(parts)
        if self._rows is None:
            return draws
        if len(self._generators) == 1:
            return draws.expand(-1, len(self._rows), *draws.shape[2:])
        return draws[:, self._rows]

    def state(self) -> dict[str, Any]:
        """Where the stream stands, for :meth:`set_state`."""
        return {"generators": torch.stack(self._before), "used": self._used}

    def set_state(self, state: dict[str, Any]) -> None:
        """Continue where :meth:`state` was taken from a stream with as many seeds.

        Raises:
            ValueError: it had another number of seeds.
        """
        pairs = zip(self._generators, state["generators"], strict=True)
        for generator, before in pairs:
            generator.set_state(before.clone())  # a view is not read from its offset
        self._refill()
        self._used = int(state["used"])


class _GivenNormals(TorchFunctionMode):
    def __init__(self, source: Iterator[Tensor]) -> None:
        super().__init__()
        self._source = source

    def __torch_function__(self, func: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        if func is torch.randn_like:
            return next(self._source)
        if func is torch.Tensor.normal_ and len(args) == 1 and not kwargs:
            return args[0].copy_(next(self._source))
        if func is torch.normal:
            mean, std = args
            return mean + std * next(self._source)
        return func(*args, **(kwargs or {}))


@contextmanager
def given_normals(source: Iterator[Tensor]) -> Iterator[None]:
    """Let PyTorch's normal distribution take its numbers from ``source`` inside the block.

    TorchRL's losses and exploration draw from the global generator; so they can be given the
    numbers of each learner instead, or numbers that a compiled graph takes as its inputs.

    Args:
        source: standard normal tensors, each of the shape of the draw that it replaces.
    """
    with _GivenNormals(source):
        yield
