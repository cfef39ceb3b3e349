"""A whole slot of training as one compiled graph: flying, storing, sampling and the update.

What the graph does is recorded from the parts that the eager path is made of: exploration, the
environment with its transforms, TorchRL's losses. Written out here is only what lies between
them: storing to and sampling from the replay buffer's own tensors, Adam on the optimizers' own
states, and the targets' soft update. Both paths share every tensor and every random number, so a
training may change over between any two episodes and a checkpoint serves both.
"""

import functools
from collections.abc import Iterable, Mapping
from typing import NamedTuple

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor
from torchrl.data import ReplayBuffer
from torchrl.envs import TransformedEnv

from hyuav._support.randomness import given_normals
from hyuav._support.recording import compile_function
from hyuav.envs.draws import GivenDraws
from hyuav.learning.algorithm import Algorithm, GradientStep
from hyuav.learning.guide.demonstrations import as_planned
from hyuav.learning.replay import sampled_slots
from hyuav.physics.tasks import Tasks


class Flown(NamedTuple):
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
        replay: which holds at least one transition.
        batch_size: K.
        carrier: what the helpers observe, (N,); an example.

    Raises:
        Exception: one of :data:`hyuav._support.recording.COMPILATION_ERRORS`.
    """

    def __init__(
        self,
        env: TransformedEnv,
        algorithm: Algorithm,
        replay: ReplayBuffer,
        batch_size: int,
        carrier: TensorDictBase,
    ) -> None:
        self._env, self._algorithm, self._replay = env, algorithm, replay
        observed = (*env.observation_spec.keys(), *env.done_keys)
        self._carrier = carrier.select(*observed).clone()
        self._adam = {step.name: AdamState(step) for step in algorithm.steps}
        weights = dict(algorithm.loss.named_parameters())
        self._targets = [
            (target, weights[name.removeprefix("target_")].data)
            for name, target in algorithm.loss.named_buffers()
            if name.startswith("target_")
        ]
        learners, device = env.batch_size[0], env.device
        self._storage = replay.storage._storage
        self._learners = torch.arange(learners, device=device).unsqueeze(-1)
        self._cursor = torch.zeros(1, dtype=torch.int64, device=device)
        self._length = torch.zeros(1, dtype=torch.int64, device=device)
        self._totals = {
            name: torch.zeros(learners, device=device) for name in ("reward", *self._adam)
        }
        self._finite = torch.zeros(learners, dtype=torch.int64, device=device)
        examples = self._examples(batch_size)
        self._names = tuple(examples)
        self._programs = {
            taken: compile_function(functools.partial(self._slot, taken), [*examples.values()])
            for taken in algorithm.all_due
        }

    def fly(self, carrier: TensorDictBase, draws: Mapping[str, Tensor], updates: int) -> Flown:
        """Fly and learn for as many slots as there are draws.

        Args:
            carrier: what the helpers observe before the first slot, (N,); left as it is.
            draws: random numbers, a slot in each row: ``exploration`` (slots, N, n, 2), standard
                normal, where the explorer draws n times; ``sampling`` (slots, N, K), uniform;
                ``losses`` (slots, N, n, K, 2), standard normal, where the losses draw n times;
                ``plan`` (slots, N, 2), actions to take whatever the explorer says, NaN for none,
                where the algorithm repeats flights; ``fading`` (slots, N, links) and ``tasks``
                (slots, N, 2, U) where the environment needs them.
            updates: taken before.
        """
        slots = len(draws["exploration"])
        self._begin(carrier)
        counts = dict.fromkeys(self._adam, 0)
        blocks = {**draws, "corrections": self._corrections(updates, slots)}
        with torch.no_grad():
            rows = zip(*(blocks[name] for name in self._names), strict=True)
            for slot, inputs in enumerate(rows):
                taken = self._algorithm.due(updates + slot + 1)
                self._programs[taken](*inputs)
                for name, due in zip(counts, taken, strict=False):
                    counts[name] += due
        self._end(updates + slots, slots)
        losses = {name: self._totals[name] / count for name, count in counts.items() if count}
        return Flown(self._totals["reward"].clone(), losses, self._finite.clone())

    def _begin(self, carrier: TensorDictBase) -> None:
        self._carrier.update_(carrier.select(*self._carrier.keys()))
        self._cursor.fill_(self._replay.writer._cursor)
        self._length.fill_(len(self._replay))
        for total in (*self._totals.values(), self._finite):
            total.zero_()

    def _end(self, updates: int, slots: int) -> None:
        """Let the eager parts know what they did not count."""
        capacity = self._replay.storage.max_size
        cursor = (self._replay.writer._cursor + slots) % capacity
        self._replay.storage._len = min(len(self._replay) + slots, capacity)
        self._replay.writer.load_state_dict({"_cursor": cursor})
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

    def _examples(self, batch_size: int) -> dict[str, Tensor]:
        """Tensors of the shapes in which a slot's random numbers come."""
        learners, device = self._env.batch_size[0], self._env.device
        physics, steps = self._env.base_env.physics, self._algorithm.steps
        normals = sum(step.normals for step in steps)
        shapes: dict[str, tuple[int, ...]] = {
            "exploration": (learners, self._algorithm.parameters.explorer_normals, 2),
            "sampling": (learners, batch_size),
            "corrections": (len(steps), 2),
        }
        if self._algorithm.parameters.repeat_every:
            shapes["plan"] = (learners, 2)
        if normals:
            shapes["losses"] = (learners, normals, batch_size, 2)
        if physics.scenario.fading:
            shapes["fading"] = (learners, physics.link_row.size)
        if physics.edge_can_saturate:
            shapes["tasks"] = (learners, 2, physics.scenario.num_ues)
        return {name: torch.zeros(shape, device=device) for name, shape in shapes.items()}

    @torch.no_grad()
    def _slot(self, taken: tuple[bool, ...], *inputs: Tensor) -> None:
        """What is recorded: one slot of all learners, with its update."""
        given = dict(zip(self._names, inputs, strict=True))
        flown = self._fly_slot(given)
        self._store(self._algorithm.parameters.memory.transition(flown))
        self._go_on(flown)
        normals = given["losses"].unbind(dim=1) if "losses" in given else ()
        with given_normals(iter(normals)):
            batch = self._algorithm.fair(self._sample(given["sampling"]))
            self._update(batch, taken, given["corrections"])
        self._totals["reward"].add_(flown["next", "reward"].squeeze(-1))
        self._finite.add_(all_finite(self._totals.values()))

    def _fly_slot(self, given: Mapping[str, Tensor]) -> TensorDictBase:
        env, draws = self._env, self._env.base_env.draws
        tasks = Tasks(*given["tasks"].unbind(dim=1)) if "tasks" in given else None
        env.base_env.draws = GivenDraws(given.get("fading"), tasks)
        try:
            with given_normals(iter(given["exploration"].unbind(dim=1))):
                action = self._algorithm.explorer(self._carrier.clone(False))
            return env.step(as_planned(action, given["plan"]) if "plan" in given else action)
        finally:
            env.base_env.draws = draws

    def _go_on(self, flown: TensorDictBase) -> None:
        """What was the next observation is now the present one."""
        following = self._env.step_mdp(flown)
        for name, values in self._carrier.items():
            values.copy_(following[name])

    def _store(self, transition: TensorDictBase) -> None:
        for name in self._algorithm.parameters.memory.names:
            self._storage[name].index_copy_(0, self._cursor, transition[name].unsqueeze(0))
        capacity = self._replay.storage.max_size
        self._cursor.copy_((self._cursor + 1) % capacity)
        self._length.copy_((self._length + 1).clamp(max=capacity))

    def _sample(self, uniform: Tensor) -> TensorDictBase:
        slots = sampled_slots(uniform, self._length)
        batch = TensorDict(batch_size=uniform.shape, device=self._env.device)
        for name in self._algorithm.parameters.memory.names:
            batch[name] = self._storage[name][slots, self._learners]
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
        step: whose optimizer's state is made, where there is none yet, and used.
    """

    def __init__(self, step: GradientStep) -> None:
        self.weights: list[Tensor] = []
        self._rows: list[tuple[Tensor, Tensor, Tensor, Tensor, float]] = []
        for group in step.optimizer.param_groups:
            self.betas, self._eps = group["betas"], group["eps"]
            for weight in group["params"]:
                state = step.optimizer.state[weight]
                if not state:
                    state["step"] = torch.zeros((), device=weight.device)
                    state["exp_avg"] = torch.zeros_like(weight)
                    state["exp_avg_sq"] = torch.zeros_like(weight)
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
