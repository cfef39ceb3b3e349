"""The transform stack between the physical environment and a learner."""

from collections.abc import Sequence

import torch
from tensordict import TensorDictBase
from torchrl.envs import (
    CatTensors,
    Compose,
    ObservationNorm,
    RewardSum,
    StepCounter,
    Transform,
    TransformedEnv,
)

from hyuav.envs.secure_offloading import SecureOffloadingEnv
from hyuav.parameters import switch
from hyuav.scenario import Scenario


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


def normalized_observation(scenario: Scenario, *, clock: bool) -> list[Transform]:
    """Gather ``observation`` (U + 5,) and bring each entry to order one by constants alone.

    Coordinates are divided by half the map's side, the mode becomes -1 (jamming) or 1 (relay),
    and distances from 0 to the map's side become -1 to 1. With a clock, the slots flown follow
    as one more entry from -1 (none) to 1 (all).
    """
    half, distances = scenario.map_side / 2, scenario.num_ues + 2
    entries = ["position", "mode", "distances"]
    loc = [0.0, 0.0, 0.5, *[half] * distances]
    scale = [half, half, 0.5, *[half] * distances]
    if clock:
        entries.append("step_count")
        loc.append(scenario.num_slots / 2)
        scale.append(scenario.num_slots / 2)
    return [
        CatTensors(entries, "observation", sort=False, del_keys=False),
        ObservationNorm(
            torch.tensor(loc),
            torch.tensor(scale),
            in_keys=["observation"],
            standard_normal=True,
        ),
    ]


def make_env(
    scenario: Scenario | str,
    scheme: str | Sequence[str] = "hybrid",
    batch_size: int | Sequence[int] = (),
    device: torch.device | str | None = None,
    seed: int | Sequence[int] | None = None,
    diagnostics: bool = False,
    *,
    clock: bool = False,
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
        clock: append the slots flown to ``observation``, which then has U + 6 entries.

    Raises:
        InputError: as :class:`SecureOffloadingEnv`.
    """
    switch("clock", clock)
    env = SecureOffloadingEnv(scenario, scheme, batch_size, device, seed, diagnostics)
    return TransformedEnv(
        env,
        Compose(
            OffMapPenalty(env.scenario.off_map_penalty),
            RewardSum(),
            StepCounter(max_steps=env.scenario.num_slots),
            *normalized_observation(env.scenario, clock=clock),
        ),
        device=env.device,
    )
