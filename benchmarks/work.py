"""The piece of work that every entry of the benchmark is given, and what an entry is."""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol, Self

from hyuav.envs.observation import ObservationLayout
from hyuav.physics.scenario import Scenario

SLOTS_AT_A_TIME = 100
"""Slots that a peer trains on between two looks at the clock."""

ENDLESS = 10**6
"""Episodes of a training that the clock ends, not the count."""


@dataclass(frozen=True)
class Work:
    """DDPG by Algorithm 1, at the paper's settings: one update after every slot.

    An update is one gradient step of the critic, one of the actor, and one of both targets. It
    begins as soon as a mini-batch is stored. Plain numbers only, so that a peer's process need
    import nothing of this project but the scenario.
    """

    scenario: Scenario
    learners: int = 1
    helpers: int = 1
    """Flown at once, where only the environment is measured."""
    episodes: int = ENDLESS
    hidden_sizes: tuple[int, ...] = (300, 100, 100)
    actor_learning_rate: float = 1e-4
    critic_learning_rate: float = 1e-4
    discount: float = 0.95
    target_rate: float = 0.005
    noise_variance: float = 0.6
    noise_decay: float = 0.999
    batch_size: int = 70
    replay_size: int = 8000
    compile: str = "auto"
    """Of this project's own training."""
    threads: int = 1
    device: str = "cpu"
    seed: int = 0

    @property
    def observation_size(self) -> int:
        """Numbers of an observation."""
        return ObservationLayout(self.scenario, clock=False).size

    def to_dict(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        return {**dataclasses.asdict(self), "scenario": self.scenario.to_dict()}

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Self:
        """Read what :meth:`to_dict` gave."""
        return cls(
            **{
                **values,
                "scenario": Scenario.from_dict(values["scenario"]),
                "hidden_sizes": tuple(values["hidden_sizes"]),
            }
        )


class Loop(Protocol):
    """An entry of the benchmark: made from :class:`Work`, then told to advance again and again."""

    width: int
    """Learners trained, or helpers flown, side by side."""

    warm_up_slots: int
    """Slots after which everything has been compiled and allocated."""

    def advance(self) -> int:
        """Go on for a while; return the slots that each learner or helper has gone through."""
