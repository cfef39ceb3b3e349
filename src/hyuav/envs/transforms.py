"""The transform stack between the physical environment and a learner."""

from collections.abc import Sequence

import torch
from tensordict import TensorDictBase
from torch import Tensor
from torchrl.data import Composite, Unbounded
from torchrl.envs import Compose, RewardSum, StepCounter, Transform, TransformedEnv

from hyuav._support.parameters import checked
from hyuav.envs.compiled import CompiledEnv
from hyuav.envs.secure_offloading import SecureOffloadingEnv
from hyuav.physics.scenario import Scenario

WITHIN = 1.0 - 1e-6
"""Of half the map's side, as near to the edge as flights should end: rounding leads no further."""


class OffMapPenalty(Transform):
    """Subtract r_om from the reward of every slot in which the flight would have left the map.

    Reads ``off_map`` (..., 1) and changes ``reward`` (..., 1) in bps/Hz.

    Args:
        penalty: r_om in bps/Hz.
    """

    def __init__(self, penalty: float) -> None:
        super().__init__(in_keys=["reward"], out_keys=["reward"])
        self.penalty = penalty

    def _step(self, _: TensorDictBase, next_tensordict: TensorDictBase) -> TensorDictBase:
        """Apply the penalty to the step that was just taken."""
        penalty = self.penalty * next_tensordict["off_map"]
        next_tensordict["reward"] = next_tensordict["reward"] - penalty
        return next_tensordict


def fenced(scenario: Scenario, position: Tensor, action: Tensor) -> Tensor:
    """Bound each component of an action (..., 2) so that the flight ends on the map.

    Args:
        scenario: its map, speed limit and slot duration.
        position: (..., 2) m, where the flight begins.
        action: velocity in units of v_max.
    """
    reach = scenario.max_speed * scenario.slot_duration
    edge = scenario.map_side / 2 * WITHIN
    return action.maximum((-edge - position) / reach).minimum((edge - position) / reach)


class Geofence(Transform):
    """Slow the flight, component by component, so that it ends on the map.

    Changes ``action`` (..., 2) on its way to the environment, given ``position`` (..., 2) m. A
    helper that is sent beyond the edge flies to it or glides along it, where without the fence it
    would be turned back and pay the penalty.

    Args:
        scenario: its map, speed limit and slot duration.
    """

    def __init__(self, scenario: Scenario) -> None:
        super().__init__(in_keys_inv=["action"], out_keys_inv=["action"])
        self._scenario = scenario

    def _inv_call(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Bound the action that the environment takes; the learner's own stays as it is."""
        tensordict["action"] = fenced(self._scenario, tensordict["position"], tensordict["action"])
        return tensordict


class NormalizedObservation(Transform):
    """Gather ``observation`` (U + 5,) and bring each entry to order one by constants alone.

    Coordinates are divided by half the map's side, the mode becomes -1 (jamming) or 1 (relay),
    and distances from 0 to the map's side become -1 to 1. With a clock, the slots flown follow
    as one more entry from -1 (none) to 1 (all).

    Args:
        scenario: its map and horizon.
        clock: append the slots flown.
    """

    def __init__(self, scenario: Scenario, *, clock: bool) -> None:
        keys = ["position", "mode", "distances", *(["step_count"] if clock else [])]
        super().__init__(in_keys=keys, out_keys=["observation"])
        self._size = scenario.num_ues + 5 + clock
        self._half_side = scenario.map_side / 2
        self._half_horizon = scenario.num_slots / 2 if clock else None

    def _call(self, next_tensordict: TensorDictBase) -> TensorDictBase:
        """Write the observation beside the entries that it is made of."""
        parts = [
            next_tensordict["position"] / self._half_side,
            next_tensordict["mode"] * 2.0 - 1.0,
            next_tensordict["distances"] * (1.0 / self._half_side) - 1.0,
        ]
        if self._half_horizon is not None:
            parts.append(next_tensordict["step_count"] / self._half_horizon - 1.0)
        next_tensordict["observation"] = torch.cat(parts, dim=-1)
        return next_tensordict

    def _reset(self, _: TensorDictBase, tensordict_reset: TensorDictBase) -> TensorDictBase:
        """Observe the start as well."""
        return self._call(tensordict_reset)

    def transform_observation_spec(self, observation_spec: Composite) -> Composite:
        """Add the observation to the specs."""
        shape = (*observation_spec.shape, self._size)
        observation_spec["observation"] = Unbounded(
            shape, dtype=torch.float32, device=observation_spec.device
        )
        return observation_spec


def make_env(
    scenario: Scenario | str,
    scheme: str | Sequence[str] = "hybrid",
    batch_size: int | Sequence[int] = (),
    device: torch.device | str | None = None,
    seed: int | list[int] | tuple[int, ...] | None = None,
    diagnostics: bool = False,
    *,
    fading: bool = False,
    clock: bool = False,
    geofence: bool = False,
    compiled: bool = False,
) -> TransformedEnv:
    """The environment as a learner sees it: :class:`SecureOffloadingEnv` with its transforms.

    To the entries of the environment are added ``observation`` (U + 5,) float32, the position,
    mode and distances normalized to order one; ``episode_reward`` (1,), the return so far in
    bps/Hz; and ``step_count`` (1,), the slots flown. ``reward`` carries the off-map penalty, and
    after T slots the episode is truncated; it never terminates.

    Args:
        scenario: as for :class:`SecureOffloadingEnv`, like the following five.
        scheme: who chooses the helper's mode.
        batch_size: of the helpers flown at once.
        device: of all tensors.
        seed: of fading and tasks, one for all or one per row.
        diagnostics: compute the ``diagnostics`` entry too.
        fading: give the ``fading`` entry too.
        clock: append the slots flown to ``observation``, which then has U + 6 entries.
        geofence: slow flights so that they end on the map; see :class:`Geofence`.
        compiled: run each slot as one compiled graph, which takes half a minute in the first step
            and pays for batches of thousands that fly thousands of slots.

    Raises:
        InputError: as :class:`SecureOffloadingEnv`.
    """
    checked(bool, "clock", clock)
    checked(bool, "geofence", geofence)
    env = SecureOffloadingEnv(scenario, scheme, batch_size, device, seed, diagnostics, fading)
    kind = CompiledEnv if checked(bool, "compiled", compiled) else TransformedEnv
    return kind(
        env,
        Compose(
            *([Geofence(env.scenario)] if geofence else []),
            OffMapPenalty(env.scenario.off_map_penalty),
            RewardSum(),
            StepCounter(max_steps=env.scenario.num_slots),
            NormalizedObservation(env.scenario, clock=clock),
        ),
        device=env.device,
    )
