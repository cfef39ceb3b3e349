"""A whole update as one compiled graph: losses, gradients, Adam and the targets' soft update.

This is the one place where PyTorch's optimizer and TorchRL's target updater are written out; the
losses remain TorchRL's. The weights and the optimizers' state are the same tensors as in the
eager path, so a training may change over at any time and a checkpoint serves both.
"""

import os
import shutil
import warnings
from collections.abc import Callable
from typing import Any

import torch
from tensordict import TensorDictBase
from torch import Tensor
from torch._dynamo.exc import BackendCompilerFailed
from torch._inductor.exc import InductorError

from hyuav.learning.algorithms import Algorithm, GradientStep

COMPILE_SECONDS = 40.0
"""What compiling takes, on two cores."""

SECONDS_SAVED = (0.004, 0.0013)
"""Saved per update, and besides that per learner and update, on two cores."""

COMPILATION_ERRORS = (BackendCompilerFailed, InductorError)
"""What the first call raises where the graph cannot be compiled, as without Python's headers."""

Losses = dict[str, Tensor]


def pays(updates: int, learners: int) -> bool:
    """Whether a training of so many updates gains more by compiling than it loses."""
    if shutil.which(os.environ.get("CXX", "g++")) is None:
        return False
    per_update, per_learner = SECONDS_SAVED
    return updates * (per_update + per_learner * learners) > COMPILE_SECONDS


class CompiledUpdate:
    """What :meth:`Algorithm.update_networks` and :meth:`~Algorithm.update_targets` do together.

    The graph is compiled in the first call, and again for every other combination of steps that
    an algorithm takes.

    Args:
        algorithm: whose weights and optimizers are used from now on.
    """

    def __init__(self, algorithm: Algorithm) -> None:
        self.algorithm = algorithm
        self._adam = {step.name: _AdamState(step) for step in algorithm.steps}
        weights = dict(algorithm.loss.named_parameters())
        self._targets = [
            (target, weights[name.removeprefix("target_")])
            for name, target in algorithm.loss.named_buffers()
            if name.startswith("target_")
        ]
        self._graphs: dict[tuple[bool, ...], Callable[[TensorDictBase], Losses]] = {}

    def __call__(self, batch: TensorDictBase, index: int) -> Losses:
        """Update with a mini-batch (N, K); ``index`` counts updates from 1.

        Returns:
            the mean loss (N,) of each step that was taken, by the step's name.
        """
        taken = (
            *(index % step.every == 0 for step in self.algorithm.steps),
            index % self.algorithm.target_every == 0,
        )
        if taken not in self._graphs:
            self._graphs[taken] = self._compile(taken)
        with torch._dynamo.config.patch(trace_autograd_ops=True), warnings.catch_warnings():
            warnings.simplefilter("ignore", FutureWarning)  # of settings that tensordict reads
            return self._graphs[taken](batch)

    def _compile(self, taken: tuple[bool, ...]) -> Callable[[TensorDictBase], Losses]:
        steps = [step for step, due in zip(self.algorithm.steps, taken[:-1], strict=True) if due]
        targets = self._targets if taken[-1] else []
        rate = 1.0 - self.algorithm.target.eps  # tau

        def update(batch: TensorDictBase) -> Losses:
            losses = {}
            for step in steps:
                adam = self._adam[step.name]
                loss = step.loss(batch.clone(False)).mean(dim=-1)  # losses write into it
                adam.step(torch.autograd.grad(loss.sum(), adam.weights))
                losses[step.name] = loss.detach()
            for target, weight in targets:
                target.lerp_(weight.data, rate)
            return losses

        options: dict[str, Any] = {"cpp.use_decompose_tanh": True, "fallback_random": True}
        return torch.compile(update, fullgraph=True, dynamic=False, options=options)


class _AdamState:
    """Adam (Kingma and Ba, ICLR 2015) on the state of a :class:`torch.optim.Adam`."""

    def __init__(self, step: GradientStep) -> None:
        self.weights: list[Tensor] = []
        self._rows: list[tuple[Tensor, Tensor, Tensor, Tensor, float]] = []
        for group in step.optimizer.param_groups:
            self._betas, self._eps = group["betas"], group["eps"]
            for weight in group["params"]:
                state = step.optimizer.state[weight]
                if not state:
                    state["step"] = torch.zeros((), device=weight.device)
                    state["exp_avg"] = torch.zeros_like(weight)
                    state["exp_avg_sq"] = torch.zeros_like(weight)
                moments = state["exp_avg"], state["exp_avg_sq"]
                self.weights.append(weight)
                self._rows.append((weight.data, *moments, state["step"], group["lr"]))

    def step(self, gradients: tuple[Tensor, ...]) -> None:
        """Move the weights against the gradients."""
        (first, second), eps = self._betas, self._eps
        for (weight, mean, square, count, rate), gradient in zip(
            self._rows, gradients, strict=True
        ):
            count.add_(1.0)
            mean.lerp_(gradient, 1.0 - first)
            square.mul_(second).addcmul_(gradient, gradient, value=1.0 - second)
            root = (square / (1.0 - second**count)).sqrt()
            weight.sub_(rate / (1.0 - first**count) * mean / (root + eps))
