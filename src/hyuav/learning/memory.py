"""How much memory a training takes, estimated before any of it is taken."""

from itertools import pairwise

import torch

from hyuav._support.errors import InputError, rejection
from hyuav._support.machine import device_memory
from hyuav.envs.observation import ObservationLayout
from hyuav.learning.algorithm import AlgorithmParameters
from hyuav.learning.guide.control_variate import HIDDEN_SIZES
from hyuav.learning.guide.reward_model import MANY_UES, POLYNOMIAL
from hyuav.physics.channel import LinkRow
from hyuav.physics.scenario import Scenario

COPIES = 16
"""Of the weights of the largest network: networks, targets, moments, gradients and best weights."""

_FLOAT = 4
"""Bytes."""


def require_memory(
    scenario: Scenario,
    horizons: tuple[int, ...],
    algorithm: AlgorithmParameters,
    sizes: dict[str, int],
    device: torch.device,
) -> None:
    """Accept a training that the device can hold.

    Args:
        scenario: that is flown.
        horizons: T of each learner.
        algorithm: whose networks are built for each.
        sizes: ``replay_size``, ``batch_size`` and ``evaluation_episodes``.
        device: of all tensors.

    Raises:
        InputError: naming what takes most, and how much there is.
    """
    learners, num_ues = len(horizons), scenario.num_ues
    observed = ObservationLayout(scenario, clock=True).size
    faded = LinkRow.of(scenario).size * algorithm.control_variate
    imagined = 2 * algorithm.imagined_flights * algorithm.control_variate
    regressed = HIDDEN_SIZES[-1] + 1 + POLYNOMIAL * num_ues * (num_ues <= MANY_UES)
    inputs = 2 * observed if algorithm.afterstate else observed + 2
    layers = (inputs, *algorithm.hidden_sizes, 2)
    widths = sum(layers)
    needed = {
        "hidden_sizes": learners * COPIES * sum((low + 1) * high for low, high in pairwise(layers)),
        "replay_size": learners
        * sizes["replay_size"]
        * (2 * observed + 6 + faded + 3 * regressed * algorithm.control_variate),
        "batch_size": learners * sizes["batch_size"] * 2 * widths,
        "evaluation_episodes": learners * sizes["evaluation_episodes"] * 4 * observed,
        "num_slots": 4 * sum(horizons),
        "imagined_flights": sum(horizons) * imagined * 3 * regressed,
    }
    available = device_memory(device)
    if _FLOAT * sum(needed.values()) > available:
        name = max(needed, key=needed.__getitem__)
        value = {
            "hidden_sizes": list(algorithm.hidden_sizes),
            "num_slots": max(horizons),
            "imagined_flights": algorithm.imagined_flights,
            **sizes,
        }
        accepted = (
            f"a training of {learners} learners that fits the device's "
            f"{available / 2**30:.3g} GiB: this one takes about "
            f"{_FLOAT * sum(needed.values()) / 2**30:.3g} GiB"
        )
        raise InputError(rejection(name, value[name], accepted))
