"""What it takes to fly alone: this project's environments, the NumPy one, and the floor."""

import numpy as np

from benchmarks.numpy_environment import NumpyEnv
from benchmarks.work import Work
from hyuav.physics.channel import LinkRow


class NumpyFlights:
    """Random flights of one helper in the NumPy environment.

    Args:
        work: its scenario is flown.
    """

    width = 1

    def __init__(self, work: Work) -> None:
        self.slots = self.warm_up_slots = work.scenario.num_slots
        self.env = NumpyEnv(work.scenario, seed=work.seed)
        generator = np.random.default_rng(work.seed)
        self.actions = generator.uniform(-1.0, 1.0, (self.slots, 2)).astype(np.float32)

    def advance(self) -> int:
        """Fly one episode."""
        self.env.reset()
        for action in self.actions:
            self.env.step(action)
        return self.slots


class TorchFlights:
    """What the three below have in common: a batch on a device, and a number of threads.

    Args:
        work: its scenario is flown by ``work.helpers`` helpers at once.
    """

    def __init__(self, work: Work) -> None:
        import torch

        torch.set_num_threads(work.threads)
        self.torch, self.work, self.width = torch, work, work.helpers
        self.slots = self.warm_up_slots = work.scenario.num_slots
        self.generator = torch.Generator(work.device).manual_seed(work.seed)
        shape = (self.slots, work.helpers, 2)
        uniform = torch.rand(shape, generator=self.generator, device=work.device)
        self.actions = 2 * uniform - 1

    def advance(self) -> int:
        """Fly one episode."""
        with self.torch.no_grad():
            self.fly()
        if self.generator.device.type == "cuda":
            self.torch.cuda.synchronize()
        return self.slots

    def fly(self) -> None:
        """One episode, on whatever device."""
        raise NotImplementedError


class LearnersEnvironment(TorchFlights):
    """Random flights in the environment as a learner sees it, with its transforms."""

    compiled = False

    def __init__(self, work: Work) -> None:
        from hyuav.envs.transforms import make_env

        super().__init__(work)
        where = work.helpers, work.device, work.seed
        self.env = make_env(work.scenario, "hybrid", *where, compiled=self.compiled)

    def fly(self) -> None:
        """One episode of the batch."""
        state = self.env.reset()
        for action in self.actions:
            state = self.env.step_mdp(self.env.step(state.set("action", action)))


class CompiledEnvironment(LearnersEnvironment):
    """The same with its slots compiled."""

    compiled = True


class RandomNumbers(TorchFlights):
    """Only the normal numbers that fading needs: no environment can be faster than its draws."""

    def fly(self) -> None:
        """The draws of one episode of the batch."""
        shape = (2, self.width, LinkRow.of(self.work.scenario).size)
        for _ in range(self.slots):
            self.torch.randn(shape, generator=self.generator, device=self.generator.device)
