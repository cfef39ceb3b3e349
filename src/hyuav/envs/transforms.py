"""The transform stack between the physical environment and a learner."""

from collections.abc import Sequence

import torch
from tensordict import TensorDictBase
from torch import Tensor
from torchrl.envs import Compose, RewardSum, StepCounter, Transform, TransformedEnv

from hyuav._support.errors import InputError, rejection
from hyuav._support.parameters import checked
from hyuav.envs.agents import GROUP, AgentsView, agent_names
from hyuav.envs.arguments import as_scenarios
from hyuav.envs.compiled import CompiledEnv
from hyuav.envs.observation import JointView
from hyuav.envs.reward import ENTRIES, EPISODE, Reward, Source
from hyuav.envs.rewards import SUM_RATE, as_reward, sum_rate
from hyuav.envs.secure_offloading import SecureOffloadingEnv
from hyuav.physics.generators import LayoutGenerator
from hyuav.physics.scenario import Scenario, ScenarioLike

WITHIN = 1.0 - 1e-6
"""Of half the map's side, as near to the edge as flights should end: rounding leads no further."""


class OffMapPenalty(Transform):
    """Subtract r_om from the reward of a slot for each helper that would have left the map.

    Reads ``off_map`` (..., H) and changes ``reward`` (..., 1).

    Args:
        penalty: r_om, in bps/Hz or whatever the reward is told in.
    """

    def __init__(self, penalty: float) -> None:
        super().__init__(in_keys=["reward"], out_keys=["reward"])
        self.penalty = penalty

    def _step(self, _: TensorDictBase, next_tensordict: TensorDictBase) -> TensorDictBase:
        """Apply the penalty to the step that was just taken."""
        reward, off_map = next_tensordict["reward"], next_tensordict["off_map"]
        penalty = self.penalty * off_map.sum(dim=-1, keepdim=True, dtype=reward.dtype)
        next_tensordict["reward"] = reward - penalty
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

    Changes the velocity in ``action`` (..., H, 2 or 3) on its way to the environment, given
    ``position`` (..., H, 2) in m. A helper that is sent beyond the edge flies to it or glides along
    it, where without the fence it would be turned back and pay the penalty.

    Args:
        scenario: its map, speed limit and slot duration.
    """

    def __init__(self, scenario: Scenario) -> None:
        super().__init__(in_keys_inv=["action"], out_keys_inv=["action"])
        self._scenario = scenario

    def _inv_call(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Bound the action that the environment takes; the learner's own stays as it is."""
        velocity, power = tensordict["action"].tensor_split([2], dim=-1)
        velocity = fenced(self._scenario, tensordict["position"], velocity)
        tensordict["action"] = torch.cat([velocity, power], dim=-1)
        return tensordict


def make_env(
    scenario: ScenarioLike | Sequence[ScenarioLike] | LayoutGenerator,
    scheme: str | Sequence[str] = "hybrid",
    batch_size: int | Sequence[int] = (),
    device: torch.device | str | None = None,
    seed: int | Sequence[int] | None = None,
    diagnostics: bool = False,
    *,
    fading: bool = False,
    clock: bool = False,
    geofence: bool = False,
    compiled: bool = False,
    agents: bool = False,
    reward: Reward | Source | str = SUM_RATE,
) -> TransformedEnv:
    """The environment as a learner sees it: :class:`SecureOffloadingEnv` with its transforms.

    To the entries of the environment are added ``observation`` float32, the positions, modes and
    distances normalized to order one, as :class:`hyuav.envs.observation.ObservationLayout` has
    them; ``episode_reward`` (1,), the return so far in bps/Hz; and ``step_count`` (1,), the slots
    flown. ``action`` (2 H,), with power control (3 H,), steers all helpers. ``reward`` carries the
    off-map penalty, and after T slots the episode is truncated; it never terminates.

    Args:
        scenario: as for :class:`SecureOffloadingEnv`, like the following five.
        scheme: who chooses the helper's mode.
        batch_size: of the helpers flown at once.
        device: of all tensors.
        seed: of fading and tasks, one for all or one per row.
        diagnostics: compute the ``diagnostics`` entry too.
        fading: give the ``fading`` entry too.
        clock: append the slots flown to ``observation``, which then has one number more.
        geofence: slow flights so that they end on the map; see :class:`Geofence`.
        compiled: run each slot as one compiled graph, which takes half a minute in the first step
            and pays for batches of thousands that fly thousands of slots.
        agents: offer each helper as an agent of the group ``helpers``, with its own observation
            and action and the reward of all; see :class:`hyuav.envs.agents.AgentsView`.
            ``env.group_map`` names them, ``helper_0`` and so on.
        reward: what a slot earns before the penalty: a :class:`hyuav.Reward`, or a function of the
            slot's outcome, a transform of TorchRL or a name, of which one is made. The penalty is
            then of the same unit.

    Raises:
        InputError: as :class:`SecureOffloadingEnv`.
    """
    checked(bool, "clock", clock)
    checked(bool, "geofence", geofence)
    checked(bool, "agents", agents)
    objective = as_reward(reward)
    fixed = scenario.scenario if isinstance(scenario, LayoutGenerator) else scenario
    below, entries, changes = _parts(objective, as_scenarios(fixed, ())[0][0])
    env = SecureOffloadingEnv(
        scenario, scheme, batch_size, device, seed, diagnostics, fading, below, entries
    )
    if changes:
        _require_numbers(objective, env.scenario, env.device)
    if agents:
        env.group_map = {GROUP: agent_names(env.scenario.num_helpers)}
    kind = CompiledEnv if checked(bool, "compiled", compiled) else TransformedEnv
    transformed = kind(
        env,
        Compose(
            *([Geofence(env.scenario)] if geofence else []),
            *changes,
            OffMapPenalty(env.scenario.off_map_penalty),
            RewardSum(),
            StepCounter(max_steps=env.scenario.num_slots),
            JointView(env.scenario, clock=clock),
            *([AgentsView(env.scenario, clock=clock)] if agents else []),
        ),
        device=env.device,
    )
    _ = transformed.input_spec  # kept from now on: torch.compile cannot record how it is made
    return transformed


def _parts(reward: Reward, scenario: Scenario) -> tuple[Reward, list[str], list[Transform]]:
    """What the environment below earns and gives beside, and the transforms that change it."""
    if not reward.is_transform:
        return reward, [], []
    changes = reward.transforms(scenario)
    entries = [key for own in changes for key in own.in_keys or () if key in ENTRIES]
    # It is known by the transform's name, and earns the sum-rate for the transform to change.
    below = Reward(sum_rate, reward.name, reward.unit, reward.depends_on or EPISODE)
    return below, entries, changes


def _require_numbers(reward: Reward, scenario: Scenario, device: torch.device | None) -> None:
    """Accept a transform that gives finite numbers where the helpers start.

    Raises:
        InputError: it fails, or gives something else.
    """
    below, entries, changes = _parts(reward, scenario)
    env = SecureOffloadingEnv(
        scenario, batch_size=3, device=device, seed=0, reward=below, entries=entries
    )
    hover = env.full_action_spec.zero()
    around = RewardSum(), StepCounter()
    try:
        flown = TransformedEnv(env, Compose(*changes, *around), device=device)
        earned = flown.step(flown.reset().update(hover))["next", "reward"]
    except Exception as error:  # whichever the transform raises
        accepted = f"a transform of TorchRL that works ({reward.told(error)})"
        raise InputError(rejection("reward", reward.name, accepted)) from error
    reward.require_numbers(earned, torch.Size((3, 1)))
