"""How much memory a training takes, estimated before any of it is taken."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import torch

from hyuav._support.errors import InputError, rejection
from hyuav._support.machine import device_memory

COPIES = 16
"""Of the weights of the largest network: networks, targets, moments, gradients and best weights."""

_FLOAT = 4
"""Bytes."""


class Need(NamedTuple):
    """What a parameter's value costs."""

    name: str
    """Of the parameter."""
    value: Any
    numbers: int
    """That are kept in memory."""


def needed_for_networks(
    observed: int, horizons: Sequence[int], layers: Sequence[int], sizes: Mapping[str, int]
) -> list[Need]:
    """What learners with these networks need.

    Args:
        observed: numbers of an observation.
        horizons: T of each learner.
        layers: widths of the largest network, from its inputs to its outputs.
        sizes: ``replay_size``, ``batch_size`` and ``evaluation_episodes``.
    """
    learners = len(horizons)
    replay_size, batch_size, episodes = (
        sizes[name] for name in ("replay_size", "batch_size", "evaluation_episodes")
    )
    weights = sum((low + 1) * high for low, high in pairwise(layers))
    return [
        Need("hidden_sizes", list(layers[1:-1]), learners * COPIES * weights),
        Need("replay_size", replay_size, learners * replay_size * (2 * observed + 6)),
        Need("batch_size", batch_size, learners * batch_size * 2 * sum(layers)),
        Need("evaluation_episodes", episodes, learners * episodes * 4 * observed),
        Need("num_slots", max(horizons), 4 * sum(horizons)),
    ]


def require_memory(needs: Sequence[Need], learners: int, device: torch.device) -> None:
    """Accept a training that the device can hold.

    Args:
        needs: of the training; several may be of one parameter.
        learners: N.
        device: of all tensors.

    Raises:
        InputError: naming what takes most, and how much there is.
    """
    available, needed = device_memory(device), _FLOAT * sum(need.numbers for need in needs)
    if needed <= available:
        return
    by_name: dict[str, int] = {}
    for need in needs:
        by_name[need.name] = by_name.get(need.name, 0) + need.numbers
    name = max(by_name, key=by_name.__getitem__)
    value = next(need.value for need in needs if need.name == name)
    accepted = (
        f"a training of {learners} learners that fits the device's {available / 2**30:.3g} GiB: "
        f"this one takes about {needed / 2**30:.3g} GiB"
    )
    raise InputError(rejection(name, value, accepted))
