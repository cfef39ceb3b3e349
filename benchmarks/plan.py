"""What a benchmark measures: its parts, who takes part, and the sizes that are tried."""

import dataclasses
from typing import Annotated, Self

import torch
from pydantic.dataclasses import dataclass

from benchmarks.worker import LIBRARIES
from hyuav._support.machine import cores, require_installed
from hyuav._support.parameters import (
    Count,
    CountOrZero,
    OneOf,
    OneOrMore,
    Parameters,
    PositiveNumber,
    parameter,
)

PARTS = ("training", "environment", "job", "references", "scaling")
PEERS = ("stable_baselines3", "sbx", "cleanrl", "torchrl")


@dataclass(frozen=True)
class Benchmark(Parameters):
    """How the benchmark is done."""

    parts: OneOrMore[Annotated[str, OneOf(*PARTS)]] = parameter(PARTS)
    peers: OneOrMore[Annotated[str, OneOf(*PEERS)]] = parameter(PEERS)
    learners: OneOrMore[Count] = parameter((1, 10))
    rounds: Count = parameter(3)
    seconds: PositiveNumber = parameter(10.0, unit="s")
    batches: OneOrMore[Count] = parameter(tuple(4**power for power in range(9)))
    episodes: Count = parameter(1000)
    scaling_learners: OneOrMore[Count] = parameter((1, 2, 4, 8, 16, 32, 64))
    cuda_learners: OneOrMore[Count] = parameter((1, 16, 256, 1024, 4096))
    ues: OneOrMore[Count] = parameter((10, 100, 1000))
    horizons: OneOrMore[Count] = parameter((10, 20, 50, 100))
    compile: Annotated[str, OneOf("auto", "always", "never")] = parameter("auto")
    quick: bool = parameter(False)
    seed: CountOrZero = parameter(0)

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
