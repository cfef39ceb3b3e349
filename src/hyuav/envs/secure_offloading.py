"""The helper's flight as a natively batched TorchRL environment."""

from collections.abc import Sequence
from typing import Any

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor
from torchrl.data import Binary, Bounded, Categorical, Composite, Unbounded
from torchrl.envs import EnvBase

from hyuav._support.errors import InputError, rejection
from hyuav._support.parameters import checked
from hyuav.envs.arguments import (
    as_batch_size,
    as_device,
    as_scenario,
    as_schemes,
    as_seed,
    as_seeds,
)
from hyuav.envs.diagnostics import Slot, diagnose, diagnostics_spec
from hyuav.envs.draws import BatchDraws, Draws, RowDraws
from hyuav.physics.offloading import prefers_relay
from hyuav.physics.scenario import Scenario
from hyuav.physics.slot import SecureOffloadingSystem


class SecureOffloadingEnv(EnvBase):
    """A helper UAV flies, and in each slot relays or jams so that the secrecy sum-rate is largest.

    Time is not limited here (:func:`hyuav.make_env` truncates after T slots) and no state is
    terminal. All entries are physical and have the batch size in front; U is the number of UEs.

    Observation:
        - ``position`` (2,) float32, m: the helper's, within the map.
        - ``mode`` (1,) int64: 1 relay, 0 jamming; after a reset, the mode at the start position.
        - ``distances`` (U + 2,) float32, m: horizontal, to the UEs in order, then L, then E.
        - ``off_map`` (1,) bool: the last flight would have left the map and was turned back.
        - ``fading`` (3 U + 2,) float32, only where asked for: the factors of unit mean by which the
          slot's fading multiplied the path gains, of the U links to L, to H and to E, H-L and H-E.
        - ``diagnostics``, only where asked for, see :mod:`hyuav.envs.diagnostics`.

    Action:
        - ``action`` (2,) float32 in [-1, 1]: the velocity in units of v_max. It is clipped, then
          shortened to the speed limit and to the helper's energy budget.

    Reward:
        - ``reward`` (1,) float32, bps/Hz: the secrecy sum-rate of the slot (eq. 6), before any
          penalty.

    Termination: never.

    A reset that is given ``position`` (2,) starts there, otherwise at ``helper_start``.

    Args:
        scenario: node positions and parameters, or the name of a preset.
        scheme: "hybrid", "relay" or "jamming"; or one of these for each row of the batch's
            first dimension.
        batch_size: of the helpers flown at once.
        device: of all tensors.
        seed: of the fading and the tasks; the same seed gives the same episode, whether or not
            diagnostics are asked for. Or one for each row of the batch's first dimension, whose
            numbers then depend on its own seed alone: rows of equal seeds are equally lucky.
        diagnostics: compute the ``diagnostics`` entry too.
        fading: give the ``fading`` entry too.

    Raises:
        InputError: (a ``ValueError``) an unknown preset, scheme or device, a negative seed.
        InputTypeError: (also a ``TypeError``) an argument of the wrong type.

    Example:
        >>> env = SecureOffloadingEnv(Scenario.preset("two_clusters"), batch_size=(4,), seed=0)
        >>> env.rollout(5)["next", "reward"].shape
        torch.Size([4, 5, 1])
    """

    def __init__(
        self,
        scenario: Scenario | str,
        scheme: str | Sequence[str] = "hybrid",
        batch_size: int | Sequence[int] = (),
        device: torch.device | str | None = None,
        seed: int | list[int] | tuple[int, ...] | None = None,
        diagnostics: bool = False,
        fading: bool = False,
    ) -> None:
        super().__init__(device=as_device(device), batch_size=as_batch_size(batch_size))
        self.system = SecureOffloadingSystem(as_scenario(scenario), self.device)
        self.schemes = as_schemes(scheme, self.batch_size)
        self.diagnostics = checked(bool, "diagnostics", diagnostics)
        self.tells_fading = checked(bool, "fading", fading)
        self._always_relay = self._rows_that_fly("relay")
        self._always_jam = self._rows_that_fly("jamming")
        norm_limit = self.system.norm_limit(self.schemes)
        self._norm_limit = None if norm_limit is None else self._per_row(norm_limit)
        self._make_specs()
        self.draws: Draws
        if isinstance(seed, list | tuple):
            self.draws = RowDraws(self.system, self.batch_size, as_seeds(seed, self.batch_size))
        else:
            self.set_seed(as_seed(seed))

    @property
    def scenario(self) -> Scenario:
        """The scenario that is flown."""
        return self.system.scenario

    @property
    def draws_tasks(self) -> bool:
        """Whether a slot's tasks are drawn: for diagnostics, or because the edge may be full."""
        return self.diagnostics or self.system.edge_can_saturate

    def _per_row(self, values: Tensor) -> Tensor:
        """Rows of values (1, k) or (rows, k), shaped to broadcast against (*batch_size, k)."""
        if values.shape[0] == 1:
            return values[0]
        inner = len(self.batch_size) - 1
        return values.reshape(-1, *(1,) * inner, values.shape[-1])

    def _rows_that_fly(self, scheme: str) -> Tensor:
        flags = [[name == scheme] for name in self.schemes]
        return self._per_row(torch.tensor(flags, device=self.device))

    def _make_specs(self) -> None:
        batch, half, device = self.batch_size, self.scenario.map_side / 2, self.device

        def flag() -> Binary:
            return Binary(1, (*batch, 1), dtype=torch.bool, device=device)

        def numbers(width: int) -> Unbounded:
            return Unbounded((*batch, width), dtype=torch.float32, device=device)

        self.observation_spec = Composite(
            position=Bounded(-half, half, (*batch, 2), dtype=torch.float32, device=device),
            mode=Categorical(2, (*batch, 1), dtype=torch.int64, device=device),
            distances=numbers(self.scenario.num_ues + 2),
            off_map=flag(),
            shape=batch,
            device=device,
        )
        if self.tells_fading:
            self.observation_spec["fading"] = numbers(3 * self.scenario.num_ues + 2)
        if self.diagnostics:
            self.observation_spec["diagnostics"] = diagnostics_spec(
                batch, self.scenario.num_ues, device
            )
        # What a step reads besides the action; a reset may be given it too.
        self.state_spec = Composite(
            position=self.observation_spec["position"].clone(), shape=batch, device=device
        )
        if self.diagnostics:
            edge_load = self.observation_spec["diagnostics", "edge_load"].clone()
            self.state_spec["diagnostics"] = Composite(
                edge_load=edge_load, shape=batch, device=device
            )
        self.action_spec = Bounded(-1.0, 1.0, (*batch, 2), dtype=torch.float32, device=device)
        self.reward_spec = numbers(1)
        self.done_spec = Composite(done=flag(), terminated=flag(), shape=batch, device=device)

    def _set_seed(self, seed: int | None) -> None:
        self.draws = BatchDraws(self.system, self.batch_size, as_seed(seed))

    def _reset(self, tensordict: TensorDictBase | None, **_: Any) -> TensorDictBase:
        position = self.start(tensordict)
        slot = self._slot(position)
        after_reset = self._observation(slot, torch.zeros_like(slot.relay_mode))
        if self.diagnostics:
            after_reset["diagnostics"] = self.observation_spec["diagnostics"].zero()
        return after_reset

    def start(self, tensordict: TensorDictBase | None) -> Tensor:
        """Where a reset that is given ``tensordict`` puts the helpers: (*batch_size, 2) m."""
        position = None if tensordict is None else tensordict.get("position", None)
        if position is None:
            return self.system.helper_start.expand(*self.batch_size, 2).clone()
        return self._checked_position(position)

    def _checked_position(self, position: Tensor) -> Tensor:
        expected, half = (*self.batch_size, 2), self.scenario.map_side / 2
        if position.shape != expected:
            raise InputError(rejection("position", tuple(position.shape), f"shape {expected}"))
        position = position.to(self.device, torch.float32, copy=True)
        outside = ~(position.abs() <= half).all(dim=-1)
        if bool(outside.any()):
            accepted = f"a position on the map, x and y in [{-half:g}, {half:g}] m"
            raise InputError(rejection("position", position[outside][0].tolist(), accepted))
        return position

    def require_action(self, action: Tensor) -> None:
        """Accept an action (*batch_size, 2).

        Raises:
            InputError: it has another shape.
        """
        expected = (*self.batch_size, 2)
        if action.shape != expected:
            raise InputError(rejection("action", tuple(action.shape), f"shape {expected}"))

    def _step(self, tensordict: TensorDictBase) -> TensorDictBase:
        position, action = tensordict["position"], tensordict["action"]
        self.require_action(action)
        action = action.to(torch.float32)  # as specified, whatever is given
        flown = self.system.move(position, action, self._norm_limit)
        slot = self._slot(flown.position)
        after = self._observation(slot, flown.off_map.unsqueeze(-1))
        after["reward"] = torch.where(
            slot.relay_mode,
            slot.relay.sum_rate.unsqueeze(-1),
            slot.jamming.sum_rate.unsqueeze(-1),
        )
        after["done"] = torch.zeros_like(slot.relay_mode)
        after["terminated"] = torch.zeros_like(slot.relay_mode)
        if self.diagnostics:
            edge_load = tensordict["diagnostics", "edge_load"]
            after["diagnostics"] = diagnose(self.system, flown, slot, edge_load)
        return after

    def _slot(self, position: Tensor) -> Slot:
        """Lines 6 to 11 of Algorithm 1 with the helper at ``position`` (*batch_size, 2) m."""
        fading = self.draws.fading()
        tasks = self.draws.tasks() if self.draws_tasks else None
        distances = self.system.distances(position)
        gains = self.system.channel_gains(distances, fading)
        admission = tasks if self.system.edge_can_saturate else None
        relay = self.system.relay_outcome(distances, gains, admission)
        jamming = self.system.jamming_outcome(gains, admission)
        relay_mode = prefers_relay(relay.sum_rate, jamming.sum_rate).unsqueeze(-1)
        relay_mode = (relay_mode | self._always_relay) & ~self._always_jam
        return Slot(position, distances, relay_mode, relay, jamming, tasks, fading)

    def _observation(self, slot: Slot, off_map: Tensor) -> TensorDictBase:
        observed = TensorDict(
            position=slot.position,
            mode=slot.relay_mode.to(torch.int64),
            distances=slot.distances,
            off_map=off_map,
            batch_size=self.batch_size,
            device=self.device,
        )
        if self.tells_fading:
            powers = self.observation_spec["fading"].one() if slot.fading is None else slot.fading
            observed["fading"] = powers
        return observed
