"""What a benchmark measures: its parts, who takes part, and the sizes that are tried."""

import dataclasses
from dataclasses import dataclass
from typing import Self

import torch

from benchmarks.worker import LIBRARIES
from hyuav._support.machine import cores, require_installed
from hyuav._support.parameters import (
    Parameters,
    choice,
    count,
    number,
    one_or_more,
    parameter,
    switch,
)

PARTS = ("training", "environment", "job", "references", "scaling")
PEERS = ("stable_baselines3", "sbx", "cleanrl", "torchrl")

_counts = one_or_more(count(), "whole numbers >= 1")


@dataclass(frozen=True)
class Benchmark(Parameters):
    """How the benchmark is done."""

    parts: tuple[str, ...] = parameter(one_or_more(choice(*PARTS), "parts"), PARTS)
    peers: tuple[str, ...] = parameter(one_or_more(choice(*PEERS), "libraries"), PEERS)
    learners: tuple[int, ...] = parameter(_counts, (1, 10))
    rounds: int = parameter(count(), 3)
    seconds: float = parameter(number(above=0.0), 10.0, unit="s")
    batches: tuple[int, ...] = parameter(_counts, tuple(4**power for power in range(9)))
    episodes: int = parameter(count(), 1000)
    scaling_learners: tuple[int, ...] = parameter(_counts, (1, 2, 4, 8, 16, 32, 64))
    cuda_learners: tuple[int, ...] = parameter(_counts, (1, 16, 256, 1024, 4096))
    ues: tuple[int, ...] = parameter(_counts, (10, 100, 1000))
    horizons: tuple[int, ...] = parameter(_counts, (10, 20, 50, 100))
    compile: str = parameter(choice("auto", "always", "never"), "auto")
    quick: bool = parameter(switch, False)
    seed: int = parameter(count(0), 0)

    def shortened(self) -> Self:
        """As it is, or where it is to be quick a small part of each part."""
        if not self.quick:
            return self
        return dataclasses.replace(
            self,
            rounds=min(self.rounds, 3),
            seconds=min(self.seconds, 1.0),
            batches=self.batches[::4],
            episodes=min(self.episodes, 50),
            scaling_learners=self.scaling_learners[:2],
            cuda_learners=self.cuda_learners[:2],
            ues=self.ues[:2],
            horizons=self.horizons[:2],
        )


def threads_to_try() -> list[int]:
    """One thread, and as many as there are cores."""
    return sorted({1, cores()})


def devices() -> list[str]:
    """The processor, and the GPU where there is one."""
    return ["cpu", "cuda"] if torch.cuda.is_available() else ["cpu"]


def require_peers(parts: tuple[str, ...], peers: tuple[str, ...]) -> None:
    """Accept peers whose libraries can be imported.

    Raises:
        InputError: naming those that cannot, and how to get them.
    """
    needed = set(peers) if "training" in parts else set()
    if {"job", "scaling"} & set(parts):
        needed |= {"stable_baselines3"} & set(peers)
    libraries = [library for peer in PEERS if peer in needed for library in LIBRARIES.get(peer, ())]
    require_installed(libraries, "bench")
