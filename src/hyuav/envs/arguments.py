"""What the environments accept as arguments, and how they answer anything else."""

import dataclasses
import operator
from collections.abc import Sequence
from typing import Any

import torch
from torch import Tensor

from hyuav._support.errors import InputError, InputTypeError, rejection
from hyuav._support.parameters import plain
from hyuav.physics.generators import LayoutGenerator
from hyuav.physics.layout import Nodes
from hyuav.physics.modes import MODE_RULES, fixed_modes
from hyuav.physics.scenario import Scenario, as_scenario, is_layout

LAYOUT = ("ue_positions", "legitimate_position", "helper_starts", "eavesdropper_positions")
"""The fields of a scenario in which the rows of a batch may differ."""


NODES = (*LAYOUT[:2], LAYOUT[3])
"""Those of nodes that do not fly."""


def as_scenarios(
    scenario: Any, batch_size: int | Sequence[int]
) -> tuple[tuple[Scenario, ...], torch.Size]:
    """One scenario for all rows, or one for each row of the batch's first dimension; and the batch.

    Those of several rows differ in their nodes' positions only, and in no number of nodes. Without
    a batch size, there is a row for each.
    """
    sizes = as_batch_size(batch_size)
    given = plain(scenario)
    if not isinstance(given, tuple) or is_layout(given):
        return (as_scenario(given),), sizes
    scenarios = tuple(as_scenario(each) for each in given)
    sizes = sizes or torch.Size((len(scenarios),))
    if not scenarios or len(scenarios) != sizes[0]:
        accepted = f"one scenario, or one for each of {sizes[0] or 'several'} rows"
        raise InputError(rejection("scenario", f"{len(scenarios)} scenarios", accepted))
    for index, other in enumerate(scenarios):
        for field in dataclasses.fields(Scenario):
            first, own = (getattr(each, field.name) for each in (scenarios[0], other))
            same = len(own) == len(first) if field.name in LAYOUT else own == first
            if not same:
                accepted = f"{field.name} as of scenario[0]: rows differ in positions only"
                raise InputError(rejection(f"scenario[{index}].{field.name}", own, accepted))
    return scenarios, sizes


def require_layouts(generator: LayoutGenerator) -> None:
    """Accept a generator whose layouts have its scenario's numbers of nodes.

    Raises:
        InputError: naming the nodes of which it draws another number.
    """
    drawn, expected = generator.draw(torch.zeros(generator.size)), Nodes.of(generator.scenario)
    for role in Nodes._fields:
        shape, own = tuple(getattr(expected, role).shape), tuple(getattr(drawn, role).shape)
        if own != shape:
            raise InputError(rejection(f"scenario.draw(...).{role}", own, f"shape {shape}"))


def as_batch_size(batch_size: int | Sequence[int]) -> torch.Size:
    """A whole number or a sequence of them, each at least 1."""
    given = plain(batch_size)
    sizes = given if isinstance(given, tuple) else (given,)
    accepted = "whole numbers >= 1"
    if not all(type(size) is int for size in sizes):
        raise InputTypeError(rejection("batch_size", batch_size, accepted))
    if any(size < 1 for size in sizes):
        raise InputError(rejection("batch_size", batch_size, accepted))
    return torch.Size(sizes)


def as_schemes(
    scheme: str | Sequence[str], batch_size: torch.Size, num_helpers: int
) -> tuple[str, ...]:
    """One scheme for all rows, or one for each row of the batch's first dimension."""
    given = plain(scheme)
    if isinstance(given, str):
        fixed_modes(given, num_helpers)
        return (given,)
    if not isinstance(given, tuple):
        raise InputTypeError(rejection("scheme", scheme, f"one of {', '.join(MODE_RULES)}"))
    for index, name in enumerate(given):
        fixed_modes(name, num_helpers, f"scheme[{index}]")
    if not batch_size or len(given) != batch_size[0]:
        rows = batch_size[0] if batch_size else 0
        raise InputError(rejection("scheme", scheme, f"one name, or one for each of {rows} rows"))
    return given


def require_shape(name: str, values: Tensor, shape: Sequence[int]) -> None:
    """Accept a tensor of this shape.

    Raises:
        InputError: it has another.
    """
    if values.shape != (expected := tuple(shape)):
        raise InputError(rejection(name, tuple(values.shape), f"shape {expected}"))


def as_device(device: torch.device | str | None) -> torch.device:
    """A device that PyTorch can place tensors on here; the CPU where none is named."""
    try:
        resolved = torch.device("cpu" if device is None else device)
        torch.empty(0, device=resolved)
    except (RuntimeError, AssertionError, TypeError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        accepted = f"a device of this machine, such as cpu or cuda ({reason})"
        raise InputError(rejection("device", device, accepted)) from None
    if resolved.type == "meta":
        raise InputError(rejection("device", device, "a device that holds numbers, such as cpu"))
    return resolved


def as_seed(seed: int | None) -> int:
    """A seed as it is, or one drawn from PyTorch's global generator where none is given."""
    if seed is None:
        return int(torch.randint(2**62, (), device="cpu"))
    accepted = "a whole number in [0, 2^63)"
    try:
        number = operator.index(seed)
    except TypeError:
        raise InputTypeError(rejection("seed", seed, accepted)) from None
    if isinstance(seed, bool):
        raise InputTypeError(rejection("seed", seed, accepted))
    if not 0 <= number < 2**63:
        raise InputError(rejection("seed", seed, accepted))
    return number


def as_seeds(seeds: Sequence[int], batch_size: torch.Size) -> tuple[int, ...]:
    """One seed for each row of the batch's first dimension."""
    rows = batch_size[0] if batch_size else 0
    if len(seeds) != rows:
        raise InputError(rejection("seed", seeds, f"one number, or one for each of {rows} rows"))
    return tuple(as_seed(seed) for seed in seeds)
