"""The generalist as a policy: any scenario, flown at once."""

from typing import NamedTuple

import torch
from tensordict import TensorDict, TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import Tensor

from hyuav.learning.generalist.decide import Choice, Helpers, World, choices, flights
from hyuav.learning.generalist.network import GeneralistNetwork
from hyuav.learning.generalist.scene import CANDIDATES, POWER_STEP, ROUGH_DRAWS, TURNS, scenes_of
from hyuav.learning.generalist.tokens import Tokens
from hyuav.physics.scenario import Scenario
from hyuav.physics.slot import Physics
from hyuav.references.power import best_levels
from hyuav.references.rewards import ExpectedReward

DRAWS_OF_SEVERAL = 4
"""Of a slot's fading, over which what it brings several helpers is averaged in flight."""


class Plan(NamedTuple):
    """A flight before it is flown."""

    path: Tensor
    """(T + 1, H, 2) m, float64."""
    share: Tensor
    """(T, H), powers in units of the nominal one, float64."""


class GeneralistPolicy(TensorDictModuleBase):
    """Fly the generalist in an environment made by :func:`hyuav.make_env`.

    Reads ``position`` (..., H, 2) m and ``step_count`` (..., 1), writes ``action`` (..., 2 H), or
    (..., 3 H) where the power is controlled. Helpers decide one after another: each knows where
    those before it go, and takes the others to stay where they are. One helper flies in that of the
    map's eight symmetries in which it earns most without fading.

    Args:
        network: of the generalist.
        scenario: that is flown.
        mode_rule: who chooses the modes.
    """

    in_keys = ("position", "step_count")
    out_keys = ("action",)

    def __init__(
        self, network: GeneralistNetwork, scenario: Scenario, mode_rule: str = "hybrid"
    ) -> None:
        super().__init__()
        self.network, self.scenario, self.mode_rule = network, scenario, mode_rule
        scenes = scenes_of(scenario, mode_rule)
        self.world = World(scenes, Tokens.of([scenario] * scenes.count))
        physics = Physics(scenario, dtype=torch.float32)
        self._rough, self._expected = (
            ExpectedReward(physics, draws, torch.Generator().manual_seed(0))
            for draws in (ROUGH_DRAWS, DRAWS_OF_SEVERAL)
        )
        self._turn = self._best_turn()

    def _best_turn(self) -> Tensor:
        """The symmetry in which it flies best from the start: each is another way to see it."""
        turns = torch.stack(TURNS)
        if self.world.scenes.count > 1:
            return turns[0]
        scene = torch.zeros(len(turns), dtype=torch.int64)
        earned, _ = flights(self.network, self.world, scene, turns)
        return turns[int(earned.argmax())]

    @torch.no_grad()
    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Write the actions of each flight in the batch."""
        position, flown = tensordict["position"], tensordict["step_count"]
        # The flights of an evaluation are all in the same place, where fading alone differs.
        flat = torch.cat([position.flatten(-2), flown.to(position.dtype)], dim=-1)
        flat = flat.reshape(-1, flat.shape[-1])
        states, own = flat.unique(dim=0, return_inverse=True)
        places = states[:, :-1].unflatten(-1, (-1, 2)).cpu()
        action = self._act(places, states[:, -1].long().cpu())
        action = action.flatten(-2).to(position)[own]
        return tensordict.set("action", action.reshape(*position.shape[:-2], -1))

    def plan(self) -> Plan:
        """The flight from the start."""
        scenario = self.scenario
        position = torch.tensor(scenario.helper_starts, dtype=torch.float32)
        step = scenario.max_speed * scenario.slot_duration
        path, shares = [position], []
        for slot in range(scenario.num_slots):
            state = TensorDict(position=path[-1], step_count=torch.tensor([slot]))
            action = self(state)["action"].unflatten(-1, (len(position), -1))
            path.append(path[-1] + step * action[:, :2])
            decibels = (action[:, 2:].sum(dim=-1) - 1.0) * scenario.power_range / 2
            controlled = torch.full_like(decibels, float(scenario.power_control))
            shares.append(10.0 ** (decibels * controlled / 10.0))
        return Plan(torch.stack(path).double(), torch.stack(shares).double())

    def _act(self, position: Tensor, flown: Tensor) -> Tensor:
        """Actions (B, H, 2 or 3) at positions (B, H, 2) m after so many slots (B,)."""
        scenes, scenario = self.world.scenes, self.scenario
        left = (scenario.num_slots - flown).clamp(min=1)
        target, share = position.clone(), torch.ones_like(position[..., 0])
        for helper in range(scenario.num_helpers):
            place = (position[:, helper] - scenes.corner[helper]) / scenes.spacing[helper]
            place = place.round().long().clamp(min=0, max=scenes.side - 1)
            scene = torch.full((len(position),), helper)
            helpers = Helpers(scene, place, left)
            choice = choices(self.network, self.world, helpers, self._turn)
            lattice = scenes.corner[helper] + scenes.spacing[helper] * place
            candidates = lattice.unsqueeze(1) + scenes.spacing[helper] * CANDIDATES
            worth, shares = self._worth(choice, candidates, helper, target, share)
            chosen = worth.argmax(dim=-1, keepdim=True)
            share[:, helper] = shares.gather(1, chosen).squeeze(-1)
            target[:, helper] = candidates.gather(1, chosen.unsqueeze(-1).expand(-1, -1, 2))[:, 0]
        action = (target - position) / (scenario.max_speed * scenario.slot_duration)
        if scenario.power_control:
            power = 1.0 + 20.0 * share.log10() / scenario.power_range
            action = torch.cat([action, power.unsqueeze(-1)], dim=-1)
        return action.clamp(-1.0, 1.0)

    def _worth(
        self, choice: Choice, candidates: Tensor, helper: int, others: Tensor, share: Tensor
    ) -> tuple[Tensor, Tensor]:
        """What candidates (B, K, 2) m of a helper are worth, and their powers: (B, K) both."""
        scenes = self.world.scenes
        if scenes.count == 1:
            return choice.worth, scenes.shares[0, choice.cell]
        places = others.unsqueeze(1).expand(-1, candidates.shape[1], -1, -1).clone()
        places[:, :, helper] = candidates
        power = share.unsqueeze(1).expand(places.shape[:-1])
        rewards, shares = best_levels(
            self._expected,
            self._rough,
            [self.mode_rule],
            places.flatten(0, 1),
            power.flatten(0, 1),
            helper,
            POWER_STEP,
        )
        now = rewards[0].reshape(candidates.shape[:2]) / scenes.best[helper].clamp(min=1e-9)
        return choice.worth - choice.rewards + now, shares[0].reshape(now.shape)
