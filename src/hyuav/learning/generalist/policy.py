"""The generalist as a policy: any scenario, flown at once."""

from typing import NamedTuple

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import Tensor

from hyuav.learning.generalist.decide import Choice, Helpers, World, choices
from hyuav.learning.generalist.network import GeneralistNetwork
from hyuav.learning.generalist.plans import (
    at_the_end,
    climbed,
    coarseness,
    roughly_best,
    settled,
    shared_draws,
)
from hyuav.learning.generalist.scene import (
    CANDIDATES,
    DRAWS,
    ROUGH_DRAWS,
    ROUGH_STEP,
    TURNS,
    scenes_of,
)
from hyuav.learning.generalist.tokens import Tokens
from hyuav.physics.scenario import Scenario
from hyuav.physics.slot import Physics
from hyuav.references.flight import towards
from hyuav.references.joint import Plan
from hyuav.references.power import best_levels
from hyuav.references.rewards import ExpectedReward

DRAWS_OF_SEVERAL = 4
"""Of a slot's fading, over which what it brings several helpers is averaged in flight."""

FEW = 32
"""Places within reach that several helpers choose from, with their powers: those worth most by few
draws at the powers of the rough flight."""

ON_FLIGHT = 1e-2
"""In m, how near to its flight a helper is on it."""


class Seen(NamedTuple):
    """How helpers look at the world, each way a row; one row may be for all."""

    turn: Tensor
    """(B, 2, 2), the symmetry in which the network sees it."""
    window: Tensor
    """(B,) m, how far from the rough flight they may go."""


class GeneralistPolicy(TensorDictModuleBase):
    """Fly the generalist in an environment made by :func:`hyuav.make_env`.

    Reads ``position`` (..., H, 2) m and ``step_count`` (..., 1), writes ``action`` (..., 2 H), or
    (..., 3 H) where the power is controlled. Helpers decide one after another: each knows where
    those before it go, and takes the others to go where a rough flight of all leads them. From the
    start it flies the best of several flights: one helper by each of the map's symmetries, led by
    the rough flight or not.

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
        self._several = scenario.num_helpers > 1
        self._rough = roughly_best(scenario, mode_rule)
        few, several = (
            shared_draws(scenario, mode_rule, count) for count in (ROUGH_DRAWS, DRAWS_OF_SEVERAL)
        )
        draws = DRAWS if scenario.power_control else 4 * DRAWS
        if self._several:
            draws = few
        scenes = scenes_of(scenario, mode_rule, draws, at_the_end(self._rough))
        self.world = World(scenes, Tokens.of([scenario] * scenes.count))
        physics = Physics(scenario, dtype=torch.float32)
        self._few_draws, self._expected, self._judging = (
            ExpectedReward(physics, count, torch.Generator().manual_seed(0))
            for count in (few, several, 4 * DRAWS)
        )
        self._seen, self._flight = self._best_flight()

    @torch.no_grad()
    def _best_flight(self) -> tuple[Seen, Plan]:
        """The flight that brings most of those to which its decisions lead, and how it looks."""
        turns = torch.stack(TURNS[:1] if self._several else TURNS)
        windows = torch.tensor([coarseness(self.scenario).spacing, torch.inf])
        ways = Seen(turns.repeat_interleave(len(windows), dim=0), windows.repeat(len(turns)))
        path, share = self._flown(ways)
        plans = [Plan(path[:, way], share[:, way]) for way in range(len(ways.turn))]
        if self._several:
            plans = climbed(self.scenario, self.mode_rule, plans)
        earned = [self.expected(plan) for plan in plans]
        best = earned.index(max(earned))
        flight = self._rough if self.expected(self._rough) >= earned[best] else plans[best]
        if self._several:
            flight = max(settled(self.scenario, self.mode_rule, flight), key=self.expected)
        return Seen(*(each[best : best + 1] for each in ways)), flight

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

    def expected(self, plan: Plan) -> float:
        """What a flight is expected to bring in bps/Hz."""
        return self._judging.of_flight(self.mode_rule, *(each.float() for each in plan))

    def plan(self) -> Plan:
        """The flight from the start."""
        return Plan(*(each.double() for each in self._flight))

    def _flown(self, seen: Seen) -> tuple[Tensor, Tensor]:
        """Flights, one for each way of looking: (T + 1, B, H, 2) m and powers (T, B, H)."""
        starts = torch.tensor(self.scenario.helper_starts, dtype=torch.float32)
        path, powers = [starts.expand(len(seen.turn), -1, -1)], []
        for slot in range(self.scenario.num_slots):
            flown = torch.full((len(seen.turn),), slot)
            target, power = self._decided(path[-1], flown, seen)
            path.append(target)
            powers.append(power)
        return torch.stack(path), torch.stack(powers)

    def _act(self, position: Tensor, flown: Tensor) -> Tensor:
        """Actions (B, H, 2 or 3) at positions (B, H, 2) m after so many slots (B,)."""
        slot = flown.clamp(max=self.scenario.num_slots - 1)
        path, powers = self._flight
        target, power = path[slot + 1], powers[slot]
        off = ((position - path[slot]).abs() > ON_FLIGHT).flatten(1).any(dim=1)
        if bool(off.any()):
            target[off], power[off] = self._decided(position[off], slot[off], self._seen)
        return towards(self.scenario, position, target, power)

    def _decided(self, position: Tensor, slot: Tensor, seen: Seen) -> tuple[Tensor, Tensor]:
        """Where helpers (B, H, 2) m fly in a slot (B,), and their powers (B, H)."""
        scenes, scenario = self.world.scenes, self.scenario
        leading = self._rough.path[slot + 1]
        target, share = leading.clone(), self._rough.share[slot]
        for helper in range(scenario.num_helpers):
            place = (position[:, helper] - scenes.corner[helper]) / scenes.spacing[helper]
            place = place.round().long().clamp(min=0, max=scenes.side - 1)
            scene = torch.full((len(position),), helper)
            helpers = Helpers(scene, place, scenario.num_slots - slot)
            choice = choices(self.network, self.world, helpers, seen.turn)
            lattice = scenes.corner[helper] + scenes.spacing[helper] * place
            candidates = lattice.unsqueeze(1) + scenes.spacing[helper] * CANDIDATES
            worth, shares = self._worth(choice, candidates, helper, target, share)
            away = (candidates - leading[:, helper].unsqueeze(1)).abs().amax(dim=-1)
            led = worth.where(away <= seen.window.unsqueeze(-1), -torch.inf)
            lost = (led == -torch.inf).all(dim=-1, keepdim=True)  # too far from the rough flight
            chosen = worth.where(lost, led).argmax(dim=-1, keepdim=True)
            share[:, helper] = shares.gather(1, chosen).squeeze(-1)
            target[:, helper] = candidates.gather(1, chosen.unsqueeze(-1).expand(-1, -1, 2))[:, 0]
        return target, share

    def _worth(
        self, choice: Choice, candidates: Tensor, helper: int, others: Tensor, share: Tensor
    ) -> tuple[Tensor, Tensor]:
        """What candidates (B, K, 2) m of a helper are worth, and their powers: (B, K) both."""
        scenes = self.world.scenes
        if not self._several:
            return choice.worth, scenes.shares[0, choice.cell]
        places = others.unsqueeze(1).expand(-1, candidates.shape[1], -1, -1).clone()
        places[:, :, helper] = candidates
        power = share.unsqueeze(1).expand(places.shape[:-1])
        later, best = choice.worth - choice.rewards, scenes.best[helper].clamp(min=1e-9)
        now = self._few_draws([self.mode_rule], places.flatten(0, 1), power.flatten(0, 1))[0]
        worth, shares = later + now.reshape(later.shape) / best, power[..., helper]
        few = worth.topk(min(FEW, worth.shape[-1]), dim=-1).indices
        row = torch.arange(len(few)).unsqueeze(-1)
        rewards, levels = best_levels(
            self._expected,
            self._few_draws,
            [self.mode_rule],
            places[row, few].flatten(0, 1),
            power[row, few].flatten(0, 1),
            helper,
            ROUGH_STEP,
        )
        now = rewards[0].reshape(few.shape) / best
        worth = torch.full_like(worth, -torch.inf).scatter(1, few, later.gather(1, few) + now)
        return worth, shares.scatter(1, few, levels[0].reshape(few.shape).to(shares.dtype))
