"""Each helper as an agent of its own, in TorchRL's grouping."""

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor
from torchrl.data import Bounded, Composite, TensorSpec, Unbounded
from torchrl.envs import Transform

from hyuav.envs.arguments import require_shape
from hyuav.envs.observation import ObservationLayout
from hyuav.physics.scenario import Scenario

GROUP = "helpers"
"""The group that all agents form."""

ENDS = ("done", "terminated", "truncated")


def agent_names(num_helpers: int) -> list[str]:
    """``helper_0``, ``helper_1`` and so on, in the order of ``helper_starts``."""
    return [f"helper_{index}" for index in range(num_helpers)]


class AgentsView(Transform):
    """Offer each helper as an agent of the group ``helpers``, as TorchRL's own environments do.

    It follows :class:`hyuav.envs.observation.JointView`, whose ``observation`` of all helpers stays
    where it is, for central critics.

    - ``("helpers", "observation")`` (H, D): what each helper observes; see
      :meth:`hyuav.envs.observation.ObservationLayout.of_each`.
    - ``("helpers", "action")`` (H, 2), with power control (H, 3), takes the place of ``action``.
    - ``("helpers", "reward")`` (H, 1), the same for all helpers, takes the place of ``reward``.
    - ``("helpers", "done")``, ``"terminated"`` and ``"truncated"`` (H, 1) repeat those of the
      episode, (1,), for each helper.

    Args:
        scenario: its numbers of nodes.
        clock: whether the slots flown are observed.

    Raises:
        InputError: (in a step) the action has another shape.
    """

    def __init__(self, scenario: Scenario, *, clock: bool) -> None:
        shared = ("observation", "reward", *ENDS)
        super().__init__(
            in_keys=list(shared),
            out_keys=[(GROUP, name) for name in shared],
            in_keys_inv=["action"],
            out_keys_inv=[(GROUP, "action")],
        )
        self.layout = ObservationLayout(scenario, clock=clock)
        """Of the observations that are read here."""

    def _step(self, _: TensorDictBase, next_tensordict: TensorDictBase) -> TensorDictBase:
        """Tell the agents what the slot brought."""
        reward = self._for_each(next_tensordict.pop("reward"))
        self._reset(next_tensordict, next_tensordict)[GROUP, "reward"] = reward
        return next_tensordict

    def _reset(self, _: TensorDictBase, tensordict_reset: TensorDictBase) -> TensorDictBase:
        """Tell the agents how it stands."""
        tensordict_reset[GROUP] = TensorDict(
            observation=self.layout.of_each(tensordict_reset["observation"]),
            **{name: self._for_each(tensordict_reset[name]) for name in ENDS},
            batch_size=(*tensordict_reset.batch_size, self.layout.num_helpers),
            device=tensordict_reset.device,
        )
        return tensordict_reset

    def _inv_call(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Put the agents' actions in one row, as :class:`JointView` takes them."""
        action = tensordict[GROUP, "action"]
        shape = (*tensordict.batch_size, self.layout.num_helpers, self.layout.size_of_each_action)
        require_shape("action", action, shape)
        tensordict["action"] = action.flatten(-2)
        return tensordict

    def transform_observation_spec(self, observation_spec: Composite) -> Composite:
        """Add the agents' observations to the specs."""
        shape = (*observation_spec.shape, self.layout.num_helpers, self.layout.size_of_each)
        observed = Unbounded(shape, dtype=torch.float32, device=observation_spec.device)
        observation_spec[GROUP] = self._group(observation_spec, observation=observed)
        return observation_spec

    def transform_action_spec(self, action_spec: Composite) -> Composite:
        """Give each agent an action of its own instead of the one for all."""
        flat = action_spec["action"]
        shape = (*action_spec.shape, self.layout.num_helpers, self.layout.size_of_each_action)
        action = Bounded(-1.0, 1.0, shape, dtype=flat.dtype, device=flat.device)
        return self._alone(action_spec, self._group(action_spec, action=action))

    def transform_reward_spec(self, reward_spec: Composite) -> Composite:
        """Give each agent the reward instead of the episode."""
        group = self._group(reward_spec, reward=self._repeated(reward_spec["reward"]))
        return self._alone(reward_spec, group)

    def transform_done_spec(self, done_spec: Composite) -> Composite:
        """Tell each agent of the episode's end too."""
        ends = {name: self._repeated(done_spec[name]) for name in ENDS}
        done_spec[GROUP] = self._group(done_spec, **ends)
        return done_spec

    def _for_each(self, values: Tensor) -> Tensor:
        """Values (..., 1) once for each helper: (..., H, 1)."""
        return torch.stack([values] * self.layout.num_helpers, dim=-2)

    def _repeated(self, spec: TensorSpec) -> TensorSpec:
        """The spec of what :meth:`_for_each` gives."""
        return spec.unsqueeze(-2).expand(*spec.shape[:-1], self.layout.num_helpers, 1)

    def _group(self, around: Composite, **entries: TensorSpec) -> Composite:
        """The spec of the group, within that of the environment."""
        shape = (*around.shape, self.layout.num_helpers)
        return Composite(**entries, shape=shape, device=around.device)

    def _alone(self, around: Composite, group: Composite) -> Composite:
        """A spec in which the group is all there is."""
        return Composite({GROUP: group}, shape=around.shape, device=around.device)
