"""What one learner sees of all helpers and how it steers them: one row of numbers for each."""

import torch
from tensordict import TensorDictBase
from torch import Tensor
from torchrl.data import Bounded, Composite, Unbounded
from torchrl.envs import Transform

from hyuav.envs.arguments import require_shape
from hyuav.physics.scenario import Scenario


class ObservationLayout:
    """Where the numbers of a learner's ``observation`` and ``action`` stand.

    An observation holds, in this order, the positions of the helpers (2 H), their modes (H) and
    their distances to the UEs, L and the eavesdroppers (H (U + 1 + E)), and with a clock the
    slots flown. An action holds the helpers' velocities (2 H), each followed by the power where
    that is controlled (3 H). All are of order one.

    Args:
        scenario: that is flown; it tells the numbers U of UEs, H of helpers, E of eavesdroppers.
        clock: whether the slots flown are observed.
    """

    def __init__(self, scenario: Scenario, *, clock: bool) -> None:
        self._clock = int(clock)
        self.num_helpers = scenario.num_helpers
        """H."""
        self.power_control = scenario.power_control
        self.size_of_each_action = scenario.action_size
        """Numbers by which an action steers one helper."""
        self.action_size = self.num_helpers * self.size_of_each_action
        """Numbers of an action."""
        self.num_distances = scenario.num_ues + 1 + scenario.num_eavesdroppers
        """Of one helper."""
        self.size = self.num_helpers * (3 + self.num_distances) + clock
        """Numbers of an observation."""
        self.size_of_each = 3 * self.num_helpers + self.num_distances + clock
        """Numbers of what each helper observes as an agent."""

    def of_each(self, values: Tensor) -> Tensor:
        """What each helper observes as an agent: (..., H, size_of_each).

        In this order: its own position (2), mode and distances to the UEs, L and the eavesdroppers
        (U + 1 + E); then position and mode of each other helper, 3 (H - 1) numbers, from the one
        after it on and with the first after the last; with a clock the slots flown.

        Args:
            values: (..., size), an observation of all helpers, or its bounds.
        """
        helpers = self.num_helpers
        sizes = [2 * helpers, helpers, helpers * self.num_distances, self._clock]
        position, mode, distances, flown = values.split(sizes, dim=-1)
        place = torch.cat([position.unflatten(-1, (helpers, 2)), mode.unsqueeze(-1)], dim=-1)
        others = [place.roll(-ahead, dims=-2) for ahead in range(1, helpers)]
        flown = flown.unsqueeze(-2).expand(*place.shape[:-1], self._clock)
        own = distances.unflatten(-1, (helpers, self.num_distances))
        return torch.cat([place, own, *others, flown], dim=-1)

    def position(self, observation: Tensor) -> Tensor:
        """Where the helpers are: (..., 2 H), in units of half the map's side.

        Args:
            observation: (..., size).
        """
        return observation[..., : 2 * self.num_helpers]

    def place(self, slots: TensorDictBase) -> Tensor:
        """Where slots (...) were spent and at which power: (..., actions).

        It is laid out as an action is: the position of each helper, in units of half the map's
        side, followed by its power in [-1, 1] where that is controlled.

        Args:
            slots: with ``action`` and the ``observation`` that follows it.
        """
        position = self.position(slots["next", "observation"])
        if not self.power_control:
            return position
        _, power = self.by_helper(slots["action"])
        return self.joined(position.unflatten(-1, (self.num_helpers, 2)), power)

    def by_helper(self, values: Tensor) -> tuple[Tensor, Tensor]:
        """The parts of an action or a place (..., actions), whose powers stand behind.

        Returns:
            two numbers of each helper (..., H, 2), velocity or position, and its power
            (..., H, 1), or (..., H, 0) where that is nominal.
        """
        each = values.unflatten(-1, (self.num_helpers, self.size_of_each_action))
        moving, power = each.tensor_split([2], dim=-1)
        return moving, power

    @staticmethod
    def joined(moving: Tensor, power: Tensor) -> Tensor:
        """What :meth:`by_helper` takes apart: (..., actions)."""
        return torch.cat([moving, power], dim=-1).flatten(-2)

    def clock(self, observation: Tensor) -> Tensor:
        """The slots flown, from -1 (none) to 1 (all): (..., 1).

        Without a clock it is a number of no meaning.

        Args:
            observation: (..., size).
        """
        return observation[..., -1:]

    def distances(self, values: Tensor) -> Tensor:
        """The part (..., H (U + 1 + E)) of an observation, or of its bounds, that is distances.

        Args:
            values: (..., size).
        """
        first = 3 * self.num_helpers
        return values[..., first : first + self.num_helpers * self.num_distances]


class JointView(Transform):
    """Let one learner see and steer all helpers, by one ``observation`` and one flat ``action``.

    Gathers ``observation`` as :class:`ObservationLayout` has it and brings each entry to order one
    by constants alone: coordinates are divided by half the map's side, a mode becomes -1 (jamming)
    or 1 (relay), and distances from 0 to the map's side become -1 to 1. With a clock, the slots
    flown follow, from -1 (none) to 1 (all). On its way to the environment, ``action`` (2 H,) gets
    the helper's axis, (H, 2); with power control these are 3 for each helper.

    Args:
        scenario: its nodes, map and horizon.
        clock: append the slots flown.

    Raises:
        InputError: (in a step) the action has another shape.
    """

    def __init__(self, scenario: Scenario, *, clock: bool) -> None:
        keys = ["position", "mode", "distances", *(["step_count"] if clock else [])]
        super().__init__(
            in_keys=keys,
            out_keys=["observation"],
            in_keys_inv=["action"],
            out_keys_inv=["action"],
        )
        self.layout = ObservationLayout(scenario, clock=clock)
        """Of the observations that are made here."""
        self._half_side = scenario.map_side / 2
        self._half_horizon = scenario.num_slots / 2 if clock else None

    def _call(self, next_tensordict: TensorDictBase) -> TensorDictBase:
        """Write the observation beside the entries that it is made of."""
        position, mode = next_tensordict["position"], next_tensordict["mode"]
        parts = [
            position.flatten(-2) / self._half_side,
            mode.to(position.dtype) * 2.0 - 1.0,
            next_tensordict["distances"].flatten(-2) * (1.0 / self._half_side) - 1.0,
        ]
        if self._half_horizon is not None:
            flown = next_tensordict["step_count"].to(position.dtype)
            parts.append(flown / self._half_horizon - 1.0)
        next_tensordict["observation"] = torch.cat(parts, dim=-1)
        return next_tensordict

    def _reset(self, _: TensorDictBase, tensordict_reset: TensorDictBase) -> TensorDictBase:
        """Observe the start as well."""
        return self._call(tensordict_reset)

    def _inv_call(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Give the action that the environment takes the helper's axis."""
        action = tensordict["action"]
        require_shape("action", action, (*tensordict.batch_size, self.layout.action_size))
        tensordict["action"] = torch.unflatten(action, -1, (self.layout.num_helpers, -1))
        return tensordict

    def transform_observation_spec(self, observation_spec: Composite) -> Composite:
        """Add the observation to the specs."""
        shape = (*observation_spec.shape, self.layout.size)
        observation_spec["observation"] = Unbounded(
            shape, dtype=torch.float32, device=observation_spec.device
        )
        return observation_spec

    def transform_action_spec(self, action_spec: Composite) -> Composite:
        """Flatten the action's spec."""
        shape = (*action_spec.shape, self.layout.action_size)
        action_spec["action"] = Bounded(
            -1.0, 1.0, shape, dtype=torch.float32, device=action_spec.device
        )
        return action_spec
