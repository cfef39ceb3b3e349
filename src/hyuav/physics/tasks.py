"""What the UEs have to compute in a slot."""

from typing import NamedTuple

import torch
from torch import Tensor

from hyuav.physics.scenario import Scenario


class Tasks(NamedTuple):
    """The UEs' tasks of one slot."""

    size: Tensor
    """S_u: (..., U) bit."""
    cycles_per_bit: Tensor
    """F_u: (..., U) cycle/bit."""

    @property
    def cpu_cycles(self) -> Tensor:
        """S_u F_u: (..., U) cycles."""
        return self.size * self.cycles_per_bit


def tasks_at(scenario: Scenario, size: Tensor, cycles_per_bit: Tensor) -> Tasks:
    """The tasks at levels (..., U) of their ranges: 0 the smallest, 1 the largest."""
    ranges = (scenario.task_size, scenario.cycles_per_bit)
    return Tasks(
        *(
            low + (high - low) * level
            for (low, high), level in zip(ranges, (size, cycles_per_bit), strict=True)
        )
    )


def draw_tasks(
    scenario: Scenario,
    shape: tuple[int, ...],
    generator: torch.Generator,
    dtype: torch.dtype = torch.float32,
) -> Tasks:
    """One slot's tasks (*shape, U), uniform over the parameter ranges."""
    levels = torch.rand(
        (2, *shape, scenario.num_ues), generator=generator, dtype=dtype, device=generator.device
    )
    return tasks_at(scenario, *levels)


def mean_tasks(scenario: Scenario, dtype: torch.dtype = torch.float32) -> Tasks:
    """Tasks (U,) of mean size and mean cycles per bit, for pictures that draw none."""
    ranges = (scenario.task_size, scenario.cycles_per_bit)
    shape = (scenario.num_ues,)
    return Tasks(*(torch.full(shape, sum(pair) / 2, dtype=dtype, device="cpu") for pair in ranges))
