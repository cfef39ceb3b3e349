"""Random numbers of a training that nothing else in the process draws from."""

from collections.abc import Iterator
from contextlib import contextmanager

import torch
from torch import Tensor


class RandomStream:
    """A course of PyTorch's global generators that is suspended while others use them.

    TorchRL's losses and distributions draw from the global generators. Within
    :meth:`active` these continue this stream; outside they are as they were.

    Args:
        seed: of the stream.
        device: whose generator the stream has beside the CPU's.
    """

    def __init__(self, seed: int, device: torch.device) -> None:
        self._devices = [device] if device.type == "cuda" else []
        with torch.random.fork_rng(devices=self._devices):
            torch.manual_seed(seed)
            self.state = self._capture()

    @contextmanager
    def active(self) -> Iterator[None]:
        """Draw from this stream inside the ``with`` block."""
        with torch.random.fork_rng(devices=self._devices):
            torch.set_rng_state(self.state["cpu"])
            for device in self._devices:
                torch.cuda.set_rng_state(self.state["cuda"], device)
            try:
                yield
            finally:
                self.state = self._capture()

    def _capture(self) -> dict[str, Tensor]:
        state = {"cpu": torch.get_rng_state()}
        for device in self._devices:
            state["cuda"] = torch.cuda.get_rng_state(device)
        return state
