"""Random numbers that belong to one row of a batch, whatever other rows there are."""

import math
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Self

import numpy as np
import torch
from torch import Tensor
from torch.overrides import TorchFunctionMode

GAMMA, MIX_1, MIX_2 = -0x61C8864680B583EB, -0x40A7B892E31B1A47, -0x6B2FB644ECCEEE15
"""The constants of SplitMix64, as signed numbers."""

BLOCK = 64
"""Draws made at once where they are asked for one by one."""


def splitmix64(state: Tensor) -> Tensor:
    """The 64 random bits of each state (...) int64; the states of a sequence are GAMMA apart.

    Steele, Lea, Flood, "Fast splittable pseudorandom number generators", OOPSLA 2014. Any
    number of a sequence can be had without those before it, in a few operations that a compiler
    fuses with what the number is used for.
    """
    state = (state ^ _shifted(state, 30)) * MIX_1
    state = (state ^ _shifted(state, 27)) * MIX_2
    return state ^ _shifted(state, 31)


def _shifted(bits: Tensor, count: int) -> Tensor:
    return (bits >> count) & ((1 << (64 - count)) - 1)


def uniform(bits: Tensor) -> Tensor:
    """Numbers in [0, 1) from 64 random bits each: (...) float32."""
    return (bits >> 40 & 0xFFFFFF).float() * 2.0**-24


def polar(bits: Tensor, dtype: torch.dtype = torch.float32) -> tuple[Tensor, Tensor]:
    """A level in (0, 1] and an angle in rad, uniform both, from 64 random bits each: (...)."""
    # 31 bits decide the level, so that the smallest is well below float32's 2^-24: bits 32 to 62.
    level = ((bits & 0x7FFFFFFF << 32).to(dtype) + 2.0**31) * 2.0**-63
    angle = (bits & 0xFFFFFFFF).to(dtype) * (2.0 * math.pi * 2.0**-32)
    return level, angle


def standard_normal(bits: Tensor) -> Tensor:
    """Normal numbers from 64 random bits each (Box and Muller, 1958): (...) float32."""
    level, angle = polar(bits)
    return (-2.0 * level.log()).sqrt() * angle.cos()


def derived_seed(seed: int, purpose: str) -> int:
    """A seed for one purpose; those of other seeds or purposes are independent of it."""
    entropy = np.random.SeedSequence([seed, zlib.crc32(purpose.encode())])
    return int(entropy.generate_state(1, np.uint64)[0] >> 1)


class RowStream:
    """Random tensors, one after another, in which each row is drawn from its own seed.

    Each number depends on its row's seed and its place alone: which draw, and where in it. So it
    does not matter what other rows there are or how many draws are made at once.

    Args:
        law: of random bits, such as :func:`uniform` and :func:`standard_normal`.
        shape: of each row's draw.
        seeds: of the rows.
        purpose: what the numbers are for; streams of other purposes are independent.
        device: of the tensors.
    """

    def __init__(
        self,
        law: Callable[[Tensor], Tensor],
        shape: tuple[int, ...],
        seeds: Sequence[int],
        purpose: str,
        device: torch.device,
    ) -> None:
        self._law, self._width = law, math.prod(shape)
        trailing = (1,) * len(shape)
        keys = [derived_seed(seed, purpose) for seed in seeds]
        self._keys = torch.tensor(keys, device=device).reshape(-1, *trailing)
        self._places = torch.arange(1, self._width + 1, device=device).reshape(shape) * GAMMA
        self._drawn = 0
        self._block: tuple[int, Tensor] | None = None

    def __iter__(self) -> Self:
        return self

    def __next__(self) -> Tensor:
        """The next draw: (rows, *shape)."""
        block, place = divmod(self._drawn, BLOCK)
        if self._block is None or self._block[0] != block:
            # Wherever drawing begins: a number's rounding may depend on its place in the block.
            self._block = block, self._numbers(block * BLOCK, BLOCK)
        self._drawn += 1
        return self._block[1][place]

    def take(self, count: int) -> Tensor:
        """The next ``count`` draws: (count, rows, *shape)."""
        numbers = self._numbers(self._drawn, count)
        self._drawn += count
        return numbers

    def _numbers(self, first: int, count: int) -> Tensor:
        draws = torch.arange(first, first + count, device=self._keys.device)
        draws = draws.reshape(-1, *(1,) * self._keys.ndim) * self._width * GAMMA
        return self._law(splitmix64(draws + self._keys + self._places))

    def state(self) -> dict[str, Any]:
        """Where the stream stands, for :meth:`set_state`."""
        return {"keys": self._keys, "drawn": self._drawn}

    def set_state(self, state: dict[str, Any]) -> None:
        """Continue where :meth:`state` was taken from a stream with as many rows.

        Raises:
            RuntimeError: it had another number of rows.
        """
        self._keys = state["keys"].to(self._keys.device).reshape(self._keys.shape)
        self._drawn, self._block = int(state["drawn"]), None


_OTHER_DRAWS = (
    *(torch.randn, torch.rand, torch.rand_like, torch.randint, torch.randperm, torch.bernoulli),
    *(torch.multinomial, torch.Tensor.uniform_, torch.Tensor.exponential_),
    *(torch.Tensor.bernoulli_, torch.Tensor.random_, torch.Tensor.cauchy_),
)
"""What nothing inside :func:`given_normals` may call."""


class _GivenNormals(TorchFunctionMode):
    def __init__(self, source: Iterator[Tensor]) -> None:
        super().__init__()
        self._source = source

    def __torch_function__(self, func: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        kwargs = kwargs or {}
        if func is torch.randn_like:
            return next(self._source)
        if func is torch.Tensor.normal_:
            return self._fill(*args, **kwargs)
        if func is torch.normal:
            return self._draw(*args, **kwargs)
        if func in _OTHER_DRAWS:
            raise RuntimeError(f"{func.__name__} would draw from the global generator")
        return func(*args, **kwargs)

    def _fill(self, values: Tensor, mean: float = 0.0, std: float = 1.0) -> Tensor:
        return values.copy_(mean + std * next(self._source))

    def _draw(self, mean: Tensor, std: Tensor) -> Tensor:
        return mean + std * next(self._source)


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
