"""What the generalist learns from: scenarios that dynamic programming has solved on a lattice."""

from collections.abc import Iterable
from typing import Any, NamedTuple, Self

import numpy as np
import torch
from torch import Tensor

from hyuav.learning.generalist.decide import Helpers, World
from hyuav.learning.generalist.scene import STEPS, Scenes, scenes_of
from hyuav.learning.generalist.tokens import Tokens
from hyuav.physics.scenario_families import Ruled
from hyuav.physics.slot import Physics
from hyuav.references.grid import reaches_of, values_to_go

LEAST = 1.0
"""bps/Hz that a flight must be able to earn, or nothing is to be learned from the scenario."""


class Lesson(NamedTuple):
    """A solved scenario."""

    ruled: Ruled
    scene: Scenes
    """(1,)."""
    to_go: Tensor
    """(T, side^2 + 1) float16: what k slots bring from each place, in units of the scene's best."""
    optimum: float
    """What the best flight earns, in the same units."""

    @classmethod
    def of(cls, ruled: Ruled) -> Self:
        """Solve a scenario with one helper; fading, which costs much, is left out."""
        scene = scenes_of(*ruled, draws=1)
        physics = Physics(ruled.scenario, dtype=torch.float64)
        spacing = float(scene.spacing)
        reach = reaches_of(physics, ruled.mode_rule, spacing)[0]
        side = scene.side
        rewards = scene.rewards[0, :-1].reshape(side, side).numpy().astype(np.float64)
        rewards = np.where(rewards < 0.0, -np.inf, rewards)
        values = values_to_go([rewards] * ruled.scenario.num_slots, reach)
        row, column = scene.start[0].tolist()
        optimum = float(reach.best(rewards + values[0])[row, column])
        # Of a place off the map nothing is asked.
        told = torch.from_numpy(np.stack(values[::-1]).reshape(len(values), -1)).clamp(min=0.0)
        to_go = torch.nn.functional.pad(told, (0, 1)).half()
        return cls(ruled, scene, to_go, optimum)

    def state_dict(self) -> dict[str, Any]:
        """What was solved, all but the scenario itself."""
        return {"scene": self.scene.entries(), "to_go": self.to_go, "optimum": self.optimum}

    @classmethod
    def from_state(cls, ruled: Ruled, state: dict[str, Any]) -> Self:
        """A lesson from its :meth:`state_dict`."""
        return cls(ruled, Scenes(**state["scene"]), state["to_go"], state["optimum"])

    @property
    def is_worthwhile(self) -> bool:
        """Whether there is anything to earn."""
        return self.optimum * float(self.scene.best) >= LEAST


class Lessons(NamedTuple):
    """Solved scenarios in a row."""

    world: World
    to_go: Tensor
    """All of :attr:`Lesson.to_go`, one under another."""
    first: Tensor
    """(S,) int64: the first row of each."""
    optimum: Tensor
    """(S,)."""

    @classmethod
    def of(cls, lessons: Iterable[Lesson]) -> Self:
        """The worthwhile ones of all lessons."""
        own = [lesson for lesson in lessons if lesson.is_worthwhile]
        scenes = Scenes.joined(lesson.scene for lesson in own)
        lengths = torch.tensor([len(lesson.to_go) for lesson in own])
        return cls(
            World(scenes, Tokens.of([lesson.ruled.scenario for lesson in own])),
            torch.cat([lesson.to_go for lesson in own]),
            lengths.cumsum(dim=0) - lengths,
            torch.tensor([lesson.optimum for lesson in own]),
        )

    def to(self, device: torch.device | str) -> Self:
        """The same on a device."""
        scenes = self.world.scenes.to(device)
        tokens = Tokens(*(part.to(device) for part in self.world.tokens))
        to_go, first, optimum = (part.to(device) for part in self[1:])
        return type(self)(World(scenes, tokens), to_go, first, optimum)

    def values(self, helpers: Helpers, index: Tensor) -> Tensor:
        """What the slots after the next one bring at best, from candidates (B, K) of the maps."""
        row = self.first[helpers.scene] + helpers.slots_left - 1
        return self.to_go[row.unsqueeze(-1), index].float()

    def anywhere(self, count: int, generator: torch.Generator) -> Helpers:
        """Helpers in any scene and slot, at any place that one of its flights can have reached."""
        scenes = self.world.scenes
        device = scenes.start.device
        scene = torch.randint(scenes.count, (count,), generator=generator).to(device)
        num_slots, start = scenes.num_slots[scene].squeeze(-1), scenes.start[scene]
        flown = (torch.rand(count, generator=generator).to(device) * num_slots).long()
        near = STEPS * flown.unsqueeze(-1)
        low, high = (start - near).clamp(min=0), (start + near).clamp(max=scenes.side - 1)
        share = torch.rand(count, 2, generator=generator).to(device)
        place = low + (share * (high - low + 1)).long()
        return Helpers(scene, place, num_slots - flown)
