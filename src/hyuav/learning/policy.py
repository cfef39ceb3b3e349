"""Actors that fly without noise: while they are trained, and as Proposed, Re-OT and Ja-OT."""

from collections.abc import Sequence
from typing import NamedTuple

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import Tensor
from torchrl.envs import TransformedEnv

from hyuav.envs.observation import ObservationLayout
from hyuav.envs.rewards import DEFAULT, SUM_RATE
from hyuav.learning.algorithm import Algorithm, AlgorithmParameters
from hyuav.learning.weights import load_weights, select_learners
from hyuav.physics.scenario import Scenario


class NoiseFreeReturn(NamedTuple):
    """What actors earn without noise, on average over the same episodes."""

    reward: Tensor
    """(N,) in the unit of the reward, accumulated, with penalties; less what a guide knows to be
    chance, so that flights are told apart that differ by less."""
    sum_rate: Tensor
    """(N,) bps/Hz, the accumulated secrecy sum-rate alone."""


@torch.no_grad()
def fly_noise_free(
    env: TransformedEnv, algorithm: Algorithm, reward_scale: float
) -> tuple[NoiseFreeReturn, Tensor]:
    """Fly actors without noise for an episode of each of an environment's rows.

    Args:
        env: (N, episodes).
        algorithm: of N learners.
        reward_scale: of the rewards that the learners store, against bps/Hz.

    Returns:
        what they earn, and where they flew in the first of the episodes, (T, N, 2), in units of
        half the map's side.
    """
    scenario, learners = env.base_env.scenario, env.batch_size[0]
    layout = ObservationLayout(scenario, clock=False)  # places stand first, clock or not
    off_map, control_term, told = torch.zeros(3, learners, device=env.device)
    is_told = env.base_env.reward != DEFAULT
    state, positions = env.reset(), []
    for _ in range(scenario.num_slots):
        slot = env.step(algorithm.actor(state))
        control_term += algorithm.guide.control_term(slot).mean(dim=(1, 2))
        state = env.step_mdp(slot)
        off_map += state["off_map"].squeeze(-1).float().mean(dim=-1)
        if is_told:
            told += state[SUM_RATE].squeeze(-1).mean(dim=-1)
        positions.append(layout.position(state["observation"])[:, 0])
    reward: Tensor = state["episode_reward"].squeeze(-1).mean(dim=-1)
    sum_rate = told if is_told else reward + scenario.off_map_penalty * off_map
    earned = NoiseFreeReturn(reward - control_term / reward_scale, sum_rate)
    return earned, torch.stack(positions)


class LearnedPolicy(TensorDictModuleBase):
    """The noise-free actors of learners, for any batch of helpers.

    Args:
        scenario: that the actor was trained on, or another with as many UEs.
        algorithm: with which it was trained.
        weights: of N learners, as a training saves them.
        learner: which of the N; or several, each of which flies one row of the batch's first
            dimension.

    Raises:
        InputError: the weights do not fit the algorithm or the number of UEs.
    """

    in_keys = ("observation",)
    out_keys = ("action",)

    def __init__(
        self,
        scenario: Scenario,
        algorithm: AlgorithmParameters,
        weights: dict[str, Tensor],
        learner: int | Sequence[int] = 0,
    ) -> None:
        super().__init__()
        self._several = not isinstance(learner, int)
        learners = [learner] if isinstance(learner, int) else learner
        built = algorithm.build(len(learners), scenario)
        load_weights(built.loss, select_learners(weights, learners))
        self.actor = built.actor

    @torch.no_grad()
    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Read ``observation`` (..., observed), write ``action`` (..., 2) in [-1, 1]."""
        observed = tensordict.select("observation")
        if self._several:
            tensordict["action"] = self.actor(observed)["action"]
        else:
            tensordict["action"] = self.actor(observed.unsqueeze(0))["action"].squeeze(0)
        return tensordict
