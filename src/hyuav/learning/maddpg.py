"""MADDPG: an actor for each helper, and a critic of all of them (Lowe et al., NeurIPS 2017)."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import torch
from pydantic.dataclasses import dataclass
from tensordict import TensorDict, TensorDictBase
from tensordict.nn import TensorDictModule
from torch import Tensor, nn

from hyuav._support.parameters import parameter
from hyuav.envs.observation import ObservationLayout
from hyuav.learning.algorithm import Algorithm
from hyuav.learning.ddpg import DDPG
from hyuav.learning.memory import Need
from hyuav.learning.networks import LearnerMLP
from hyuav.physics.scenario import Scenario


class HelperActors(LearnerMLP):
    """mu_i(o_i) of each helper i, from the observation of all and to the action of all.

    Args:
        learners: N.
        layout: tells what of the observation each helper sees.
        hidden_sizes: of the hidden layers.
        activation: of the hidden layers.
        output: applied to the last layer's result.
        shared: one network for all helpers, which is told by H more numbers which one it steers,
            instead of one for each.
    """

    def __init__(
        self,
        learners: int,
        layout: ObservationLayout,
        hidden_sizes: Sequence[int],
        activation: str,
        output: nn.Module,
        *,
        shared: bool,
    ) -> None:
        helpers = layout.num_helpers
        is_one, told = shared or helpers == 1, helpers if shared and helpers > 1 else 0
        super().__init__(
            learners,
            layout.size_of_each + told,
            hidden_sizes,
            layout.size_of_each_action,
            activation,
            output,
            members=None if is_one else helpers,
        )
        self._layout, self._is_one, self._told = layout, is_one, told

    def forward(self, *inputs: Tensor) -> Tensor:
        """Map an observation (N, ..., observed) to actions (N, ..., H actions)."""
        (observation,) = inputs
        seen = self._layout.of_each(observation)
        if self._told:
            which = torch.eye(self._told, dtype=seen.dtype, device=seen.device)
            seen = torch.cat([seen, which.expand(*seen.shape[:-1], self._told)], dim=-1)
        if self._is_one:
            return super().forward(seen).flatten(-2)
        rows = seen.movedim(-2, 0)
        actions = super().forward(rows.flatten(0, 1)).unflatten(0, rows.shape[:2])
        return actions.movedim(0, -2).flatten(-2)


@dataclass(frozen=True)
class MADDPG(DDPG):
    """DDPG's hyperparameters, and who has an actor of its own.

    Each helper's actor sees what :meth:`hyuav.envs.observation.ObservationLayout.of_each` tells.
    All earn the same reward, so that one critic of the joint observation and all actions serves
    them. With one helper it is DDPG, number for number.
    """

    shared_actor: bool = parameter(False)
    """One actor for all helpers, which is told which of them it steers."""

    def build(self, learners: int, scenario: Scenario) -> Algorithm:
        """See :meth:`AlgorithmParameters.build`."""
        algorithm = super().build(learners, scenario)
        critic, actor = algorithm.steps
        actor = replace(actor, loss=lambda batch: actor_loss(algorithm, batch, scenario))
        return replace(algorithm, steps=(critic, actor))

    def make_actor(self, learners: int, scenario: Scenario) -> TensorDictModule:
        """See :meth:`AlgorithmParameters.make_actor`."""
        actors = HelperActors(
            learners,
            ObservationLayout(scenario, clock=self.clock),
            self.hidden_sizes,
            self.activation,
            self.make_actor_output(),
            shared=self.shared_actor,
        )
        return TensorDictModule(actors, in_keys=["observation"], out_keys=["action"])

    def needed_memory(
        self, scenario: Scenario, horizons: Sequence[int], sizes: Mapping[str, int]
    ) -> list[Need]:
        """See :meth:`AlgorithmParameters.needed_memory`: an actor, and a mini-batch, for each."""
        needs = super().needed_memory(scenario, horizons, sizes)
        several = ("hidden_sizes", "batch_size")
        return [
            need._replace(numbers=need.numbers * scenario.num_helpers)
            if need.name in several
            else need
            for need in needs
        ]


def actor_loss(algorithm: Algorithm, batch: TensorDictBase, scenario: Scenario) -> Tensor:
    """-Q(s, a_1, ..., mu_i(o_i), ..., a_H), the mean over the helpers i: (N, K).

    The others' actions are those that were taken, as in the paper's policy gradient.

    Args:
        algorithm: of N learners, whose critic is not changed.
        batch: (N, K) transitions.
        scenario: tells the number of helpers.
    """
    helpers = scenario.num_helpers
    chosen, taken = (
        action.unflatten(-1, (helpers, -1)).unsqueeze(-3)
        for action in (algorithm.act(batch), batch["action"])
    )
    own = torch.eye(helpers, dtype=torch.bool, device=taken.device).unsqueeze(-1)
    action = torch.where(own, chosen, taken).flatten(-2)
    observation = batch["observation"].unsqueeze(-2).expand(*action.shape[:-1], -1)
    joint = TensorDict(observation=observation, action=action, batch_size=action.shape[:-1])
    loss = algorithm.loss
    with loss.value_network_params.data.to_module(loss.value_network, preserve_module_state=False):
        value: Tensor = loss.value_network(joint)["state_action_value"]
    return -value.squeeze(-1).mean(dim=-1)
