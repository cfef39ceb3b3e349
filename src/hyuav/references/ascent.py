"""Flights of several helpers made better by the gradient of what they bring.

The model is differentiable, so places and powers of all helpers in all slots move together uphill,
where a program that improves one helper after another stops at the first flight that none of them
alone makes better. Where the reward jumps (a UE is covered or not, its rate secret enough or not)
there is no gradient, so the flights are to begin on the right side.
"""

from collections.abc import Sequence

import torch
from torch import Tensor

from hyuav.physics.modes import allowed_vectors
from hyuav.physics.slot import Physics
from hyuav.references.joint import Plan
from hyuav.references.rewards import ExpectedReward

STEPS = 100
"""Of gradient ascent (Adam)."""

VELOCITY_RATE, POWER_RATE = 0.1, 3.0
"""How far a step moves at first: a velocity in units of v_max, a power in dB."""

LAST_RATE = 0.05
"""What is left of that at the end."""

MOMENTUM = 0.8, 0.95
"""Adam's, short for so few steps."""

MODES_EVERY = 20
"""Steps for which slots keep their modes."""

SMALLEST = 1e-6
"""bps/Hz, of returns whose logarithm rises; so flights that bring little move as much as others."""


class Ascent:
    """Gradient ascent on flights.

    Args:
        physics: of the scenario.
        mode_rule: who chooses the modes.
        draws: of a slot's fading and tasks that its reward is averaged over.
        seed: of the draws.
    """

    def __init__(self, physics: Physics, mode_rule: str, draws: int, seed: int) -> None:
        self._physics = physics
        self._expected = ExpectedReward(physics, draws, torch.Generator().manual_seed(seed))
        self._vectors = allowed_vectors(mode_rule, physics.scenario.num_helpers)
        limit = physics.norm_limit([mode_rule])
        self._norm_limit = None if limit is None else limit[0]

    @torch.enable_grad()
    def improved(self, plans: Sequence[Plan], steps: int = STEPS) -> list[Plan]:
        """Each flight after as many steps as served it best; they climb side by side."""
        scenario = self._physics.scenario
        paths, powers = (
            torch.stack(each).to(self._physics.dtype) for each in zip(*plans, strict=True)
        )
        lowest = -scenario.power_range if scenario.power_control else 0.0
        velocity = paths.diff(dim=1) / (scenario.max_speed * scenario.slot_duration)
        decibels = (10.0 * powers.log10()).clamp(lowest, 0.0)
        moved = velocity.requires_grad_(), decibels.requires_grad_()
        rates = VELOCITY_RATE, POWER_RATE
        optimizer = torch.optim.Adam([{"params": [each]} for each in moved], betas=MOMENTUM)
        best, best_paths, best_powers = paths.new_full((len(paths),), -torch.inf), paths, powers
        for step in range(steps + 1):
            flown, sent = self._flown(paths[:, 0], velocity), 10.0 ** (decibels / 10.0)
            if step % MODES_EVERY == 0:
                modes = self._best_modes(flown, sent)
            earned = self._rewards(flown, sent, modes).sum(dim=1)
            better = (earned > best).reshape(-1, 1, 1)
            best = torch.maximum(best, earned.detach())
            best_paths = torch.where(better.unsqueeze(-1), flown.detach(), best_paths)
            best_powers = torch.where(better, sent.detach(), best_powers)
            falling = earned.clamp(min=SMALLEST).log().sum().neg()
            left = LAST_RATE + (1.0 - LAST_RATE) * (1.0 - step / steps)
            slopes = torch.autograd.grad(falling, moved)
            groups = optimizer.param_groups
            for group, rate, each, slope in zip(groups, rates, moved, slopes, strict=True):
                group["lr"], each.grad = rate * left, slope.nan_to_num(0.0, 0.0, 0.0)
            optimizer.step()
            with torch.no_grad():
                velocity.clamp_(-1.0, 1.0)
                decibels.clamp_(lowest, 0.0)
        return list(map(Plan, best_paths, best_powers))

    def _flown(self, starts: Tensor, velocity: Tensor) -> Tensor:
        """The paths (B, T + 1, H, 2) m of velocities (B, T, H, 2) in units of v_max."""
        places = [starts]
        for action in velocity.unbind(dim=1):
            flying = self._physics.velocity(action, self._norm_limit)
            places.append(self._physics.move(places[-1], flying).position)
        return torch.stack(places, dim=1)

    @torch.no_grad()
    def _best_modes(self, paths: Tensor, powers: Tensor) -> Tensor:
        """Which of the modes bring most in the mean of each slot: (B, T)."""
        size = powers.shape[:2]
        if len(self._vectors) == 1:
            return torch.zeros(size, dtype=torch.int64, device="cpu")
        each = [
            self._rewards(paths, powers, torch.full(size, mode, device="cpu"))
            for mode in range(len(self._vectors))
        ]
        return torch.stack(each).argmax(dim=0)

    def _rewards(self, paths: Tensor, powers: Tensor, modes: Tensor) -> Tensor:
        """What slots bring in given modes: (B, T) bps/Hz."""
        places, shares, own = paths[:, 1:].flatten(0, 1), powers.flatten(0, 1), modes.flatten()
        rewards = places.new_zeros(len(own))
        for mode in own.unique().tolist():
            slots = (own == mode).nonzero().squeeze(-1)
            rates = self._expected.drawn([self._vectors[mode]], places[slots], shares[slots])
            rewards = rewards.index_add(0, slots, rates[0].mean(dim=-1))
        return rewards.reshape(modes.shape)
