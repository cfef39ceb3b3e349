"""The arithmetic floor: what an update must compute, and how fast this machine multiplies."""

import itertools
import time
from collections.abc import Sequence

import torch

MATRIX_SIZES = (256, 512, 1024, 2048)
"""Of the square products whose best rate counts as the machine's."""


def update_flops(observation_size: int, hidden_sizes: Sequence[int], batch_size: int) -> int:
    """Floating-point operations in the matrix products of one DDPG update.

    With A and C the products (multiply-adds per transition) of the actor's and of the critic's
    layers, and A', C' the same without the first layer, an update needs

    - for the target: the target actor forward (A), the target critic forward (C);
    - for the critic's step: forward (C), gradients of the weights (C) and of the activations (C',
      as nobody asks for the gradient of its inputs);
    - for the actor's step: actor forward (A), critic forward (C), the critic's gradients of the
      activations down to the action (C), then the actor's of the weights (A) and of the
      activations (A'),

    that is 3 A + A' + 5 C + C' multiply-adds, two operations each, for each transition. Adding
    biases, activation functions, Adam and the soft update are not products and left out, which
    makes the floor a lower bound of the time.

    Args:
        observation_size: numbers of an observation.
        hidden_sizes: of both networks.
        batch_size: K.
    """
    actor = [observation_size, *hidden_sizes, 2]
    critic = [observation_size + 2, *hidden_sizes, 1]
    multiply_adds = (
        3 * _products(actor) + _products(actor[1:]) + 5 * _products(critic) + _products(critic[1:])
    )
    return 2 * multiply_adds * batch_size


def _products(sizes: Sequence[int]) -> int:
    return sum(before * after for before, after in itertools.pairwise(sizes))


def matrix_rate(threads: int, device: str = "cpu", seconds: float = 0.5) -> float:
    """The best rate of float32 matrix products, in floating-point operations per second.

    Args:
        threads: of PyTorch.
        device: to multiply on.
        seconds: for each of the sizes.
    """
    before = torch.get_num_threads()
    torch.set_num_threads(threads)
    try:
        return max(_matrix_rate(size, device, seconds) for size in MATRIX_SIZES)
    finally:
        torch.set_num_threads(before)


def _matrix_rate(size: int, device: str, seconds: float) -> float:
    left, right = torch.rand(2, size, size, device=device)
    product = torch.mm(left, right)
    best, end = 0.0, time.perf_counter() + seconds
    repeats = max(1, 2**28 // size**3)  # so that a look at the clock costs nothing
    while time.perf_counter() < end:
        _wait_for(device)
        begun = time.perf_counter()
        for _ in range(repeats):
            torch.mm(left, right, out=product)
        _wait_for(device)
        rate = 2 * size**3 * repeats / (time.perf_counter() - begun)
        best = max(best, rate)
    return best


def _wait_for(device: str) -> None:
    if device != "cpu":
        torch.cuda.synchronize()
