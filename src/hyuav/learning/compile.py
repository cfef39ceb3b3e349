"""A whole slot of training as one compiled graph: flying, storing, sampling and the update.

What the graph does is recorded from the parts that the eager path is made of: exploration, the
environment with its transforms, TorchRL's losses. Written out here is only what lies between
them: storing to and sampling from the replay buffer's own tensors, Adam on the optimizers' own
states, and the targets' soft update. Both paths share every tensor and every random number, so a
training may change over between any two episodes and a checkpoint serves both. The paths are
held equal by tests.
"""

import functools
from collections.abc import Iterable, Mapping
from typing import NamedTuple

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor
from torchrl.data import ReplayBuffer
from torchrl.envs import TransformedEnv

from hyuav._support.randomness import RowStream, given_normals
from hyuav._support.recording import compile_function
from hyuav.envs.draws import GivenDraws
from hyuav.learning.algorithm import Algorithm, GradientStep
from hyuav.learning.exploration import as_planned
from hyuav.learning.replay import TransitionOptions, sampled_slots
from hyuav.learning.torchrl_internals import cursor_of, set_filled
from hyuav.physics.tasks import Tasks


class FlownEpisode(NamedTuple):
    """What an episode brought to each of N learners."""

    reward: Tensor
    """(N,) bps/Hz, accumulated."""
    losses: dict[str, Tensor]
    """(N,), each gradient step's mean."""
    finite: Tensor
    """(N,), in how many slots, from the first, rewards and losses were finite numbers."""


def all_finite(values: Iterable[Tensor]) -> Tensor:
    """Of which learners all these (N,) are finite numbers: (N,) bool."""
    return torch.stack([each.isfinite() for each in values]).all(dim=0)


class CompiledSlots:
    """Lines 4 to 15 of Algorithm 1 for N learners of one horizon.

    Args:
        env: of batch size (N,).
        algorithm: whose weights and optimizers' states are changed.
        transitions: what is kept of each slot.
        replay: whose slots are changed.
        stored: those, (capacity, N).
        streams: of random numbers: ``exploration`` (N, n, 2), standard normal, where the
            explorer draws n times; ``sampling`` (N, K), uniform; ``losses`` (N, n, K, 2),
            standard normal, where the losses draw n times. The environment has its own.
        observed: what the helpers observe, (N,); an example.

    Raises:
        Exception: one of :data:`hyuav._support.recording.COMPILATION_ERRORS`.
    """

    def __init__(
        self,
        env: TransformedEnv,
        algorithm: Algorithm,
        transitions: TransitionOptions,
        replay: ReplayBuffer,
        stored: TensorDictBase,
        streams: Mapping[str, RowStream],
        observed: TensorDictBase,
    ) -> None:
        self._env, self._algorithm, self._streams = env, algorithm, streams
        self._transitions, self._replay, self._stored = transitions, replay, stored
        self._observed = observed.clone()
        self._adam = {step.name: AdamState(step) for step in algorithm.steps}
        weights = dict(algorithm.loss.named_parameters())
        self._targets = [
            (target, weights[name.removeprefix("target_")].data)
            for name, target in algorithm.loss.named_buffers()
            if name.startswith("target_")
        ]
        learners, device = env.batch_size[0], env.device
        self._learners = torch.arange(learners, device=device).unsqueeze(-1)
        self._cursor = torch.zeros(1, dtype=torch.int64, device=device)
        self._length = torch.zeros(1, dtype=torch.int64, device=device)
        self._totals = {
            name: torch.zeros(learners, dtype=torch.float32, device=device)
            for name in ("reward", *self._adam)
        }
        self._finite = torch.zeros(learners, dtype=torch.int64, device=device)
        no_slots = self._inputs(algorithm.guide.plan(episode=1), 0, 0)
        self._names = tuple(no_slots)
        examples = [each.new_zeros(each.shape[1:]) for each in no_slots.values()]
        self._programs = {
            taken: compile_function(functools.partial(self._slot, taken), examples)
            for taken in algorithm.all_due
        }

    def fly(
        self,
        observed: TensorDictBase,
        plan: Tensor | None,
        slots: int,
        updates: int,
    ) -> FlownEpisode:
        """Fly and learn for some slots.

        Args:
            observed: what the helpers observe before the first slot, (N,); left as it is.
            plan: see :meth:`hyuav.learning.algorithm.Guidance.plan`.
            slots: how many.
            updates: taken before.
        """
        self._begin(observed)
        counts = dict.fromkeys(self._adam, 0)
        blocks = self._inputs(plan, slots, updates)
        with torch.no_grad():
            for slot, inputs in enumerate(zip(*blocks.values(), strict=True)):
                taken = self._algorithm.due(updates + slot + 1)
                self._programs[taken](*inputs)
                for name, due in zip(counts, taken, strict=False):
                    counts[name] += due
        self._end(updates + slots, slots)
        losses = {name: self._totals[name] / count for name, count in counts.items() if count}
        return FlownEpisode(self._totals["reward"].clone(), losses, self._finite.clone())

    def _inputs(self, plan: Tensor | None, slots: int, updates: int) -> dict[str, Tensor]:
        """What differs from slot to slot, a slot in each row: random numbers, Adam's corrections.

        With no slots, they tell the shapes.
        """
        env = self._env.base_env
        blocks = {name: stream.take(slots) for name, stream in self._streams.items()}
        blocks["corrections"] = self._corrections(updates, slots)
        if plan is not None:
            blocks["plan"] = plan[:slots]
        if env.scenario.fading:
            blocks["fading"] = env.draws.take_fading(slots).contiguous()  # where rows are shared
        if env.physics.edge_can_saturate:
            blocks["tasks"] = env.draws.take_tasks(slots).contiguous()
        return blocks

    def _begin(self, observed: TensorDictBase) -> None:
        self._observed.update_(observed)
        self._cursor.fill_(cursor_of(self._replay))
        self._length.fill_(len(self._replay))
        for total in (*self._totals.values(), self._finite):
            total.zero_()

    def _end(self, updates: int, slots: int) -> None:
        """Let the eager parts know what they did not count."""
        capacity = self._replay.storage.max_size
        length = min(len(self._replay) + slots, capacity)
        set_filled(self._replay, length, (cursor_of(self._replay) + slots) % capacity)
        for step in self._algorithm.steps:
            self._adam[step.name].set_count(updates // step.every)

    def _corrections(self, updates: int, slots: int) -> Tensor:
        """Adam's bias corrections in each slot and gradient step: (slots, steps, 2)."""
        exact = {"dtype": torch.float64, "device": self._env.device}
        index = torch.arange(updates + 1, updates + slots + 1, **exact).unsqueeze(-1)
        every = torch.tensor([step.every for step in self._algorithm.steps], **exact)
        betas = [self._adam[step.name].betas for step in self._algorithm.steps]
        powers = torch.tensor(betas, **exact) ** (index // every).unsqueeze(-1)
        first, second = (1.0 / (1.0 - powers)).unbind(dim=-1)
        return torch.stack([first, second.sqrt()], dim=-1).float()

    @torch.no_grad()
    def _slot(self, taken: tuple[bool, ...], *inputs: Tensor) -> None:
        """What is recorded: one slot of all learners, with its update."""
        given = dict(zip(self._names, inputs, strict=True))
        flown = self._fly_slot(given)
        self._store(self._transitions.transition(flown))
        self._observe(flown)
        normals = given["losses"].unbind(dim=1) if "losses" in given else ()
        with given_normals(iter(normals)):
            batch = self._algorithm.guide.prepare(self._sample(given["sampling"]))
            self._update(batch, taken, given["corrections"])
        self._totals["reward"].add_(flown["next", "reward"].squeeze(-1))
        self._finite.add_(all_finite(self._totals.values()))

    def _fly_slot(self, given: Mapping[str, Tensor]) -> TensorDictBase:
        env, draws = self._env, self._env.base_env.draws
        tasks = Tasks(*given["tasks"].unbind(dim=1)) if "tasks" in given else None
        env.base_env.draws = GivenDraws(given.get("fading"), tasks)
        try:
            with given_normals(iter(given["exploration"].unbind(dim=1))):
                action = self._algorithm.explorer(self._observed.clone(False))
            return env.step(as_planned(action, given["plan"]) if "plan" in given else action)
        finally:
            env.base_env.draws = draws

    def _observe(self, flown: TensorDictBase) -> None:
        """What was the next observation is now the present one."""
        following = self._env.step_mdp(flown)
        for name, values in self._observed.items():
            values.copy_(following[name])

    def _store(self, transition: TensorDictBase) -> None:
        for name in self._transitions.names:
            self._stored[name].index_copy_(0, self._cursor, transition[name].unsqueeze(0))
        capacity = self._replay.storage.max_size
        self._cursor.copy_((self._cursor + 1) % capacity)
        self._length.copy_((self._length + 1).clamp(max=capacity))

    def _sample(self, uniform: Tensor) -> TensorDictBase:
        slots = sampled_slots(uniform, self._length)
        batch = TensorDict(batch_size=uniform.shape, device=self._env.device)
        for name in self._transitions.names:
            batch[name] = self._stored[name][slots, self._learners]
        return batch

    def _update(self, batch: TensorDictBase, taken: tuple[bool, ...], corrections: Tensor) -> None:
        for index, step in enumerate(self._algorithm.steps):
            if not taken[index]:
                continue
            with torch.enable_grad():
                loss = step.loss(batch.clone(False)).mean(dim=-1)  # losses write into it
                adam = self._adam[step.name]
                gradients = torch.autograd.grad(loss.sum(), adam.weights)
            adam.step(gradients, *corrections[index])
            self._totals[step.name].add_(loss.detach())
        if taken[-1]:
            for target, weight in self._targets:
                target.lerp_(weight, 1.0 - self._algorithm.target.eps)  # tau


class AdamState:
    """Adam (Kingma and Ba, ICLR 2015) on the state of a :class:`torch.optim.Adam`.

    Args:
        step: whose optimizer's state is used.
    """

    def __init__(self, step: GradientStep) -> None:
        self.weights: list[Tensor] = []
        self._rows: list[tuple[Tensor, Tensor, Tensor, Tensor, float]] = []
        for group in step.optimizer.param_groups:
            self.betas, self._eps = group["betas"], group["eps"]
            for weight in group["params"]:
                state = step.optimizer.state[weight]
                moments = state["exp_avg"], state["exp_avg_sq"]
                self.weights.append(weight)
                self._rows.append((weight.data, *moments, state["step"], group["lr"]))

    def set_count(self, count: int) -> None:
        """How many steps have been taken."""
        for *_, steps, _ in self._rows:
            steps.fill_(count)

    def step(self, gradients: tuple[Tensor, ...], first: Tensor, second: Tensor) -> None:
        """Move the weights against the gradients.

        Args:
            gradients: one for each of the weights.
            first: bias correction of the gradients' mean.
            second: and of their root mean square.
        """
        decay, square_decay = self.betas
        for (weight, mean, square, _, rate), gradient in zip(self._rows, gradients, strict=True):
            mean.lerp_(gradient, 1.0 - decay)
            square.lerp_(gradient.square(), 1.0 - square_decay)
            weight.sub_(rate * first * mean / (square.sqrt() * second + self._eps))
