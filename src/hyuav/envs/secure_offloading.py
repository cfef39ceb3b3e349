"""The helper's flight as a natively batched TorchRL environment."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from tensordict import TensorDict, TensorDictBase
from torch import Tensor
from torchrl.data import Binary, Bounded, Categorical, Composite, Unbounded
from torchrl.envs import EnvBase

from hyuav._support.errors import InputError, InputTypeError, rejection, require_choice
from hyuav._support.parameters import checked, plain
from hyuav.envs.arguments import (
    NODES,
    as_device,
    as_scenarios,
    as_schemes,
    as_seed,
    as_seeds,
    require_layouts,
    require_shape,
)
from hyuav.envs.diagnostics import diagnose, diagnostics_spec
from hyuav.envs.draws import Draws
from hyuav.envs.recorder import FlightRecorder
from hyuav.envs.reward import ENTRIES, FUNCTION, Reward, Source
from hyuav.envs.rewards import DEFAULT, SUM_RATE, as_reward
from hyuav.physics.generators import LayoutGenerator
from hyuav.physics.layout import Nodes
from hyuav.physics.modes import ModeRule
from hyuav.physics.outcome import Control, SlotOutcome
from hyuav.physics.scenario import Scenario, ScenarioLike
from hyuav.physics.slot import Physics, slot
from hyuav.physics.tasks import Tasks


class SecureOffloadingEnv(EnvBase):
    """Helper UAVs fly, and in each slot relay or jam so that the secrecy sum-rate is largest.

    Time is not limited here (:func:`hyuav.make_env` truncates after T slots) and no state is
    terminal. All entries are physical and have the batch size in front; U is the number of UEs, H
    of helpers and E of eavesdroppers.

    Observation:
        - ``position`` (H, 2) float32, m: the helpers', within the map.
        - ``mode`` (H,) int64: 1 relay, 0 jamming; after a reset, the mode at the start position.
        - ``distances`` (H, U + 1 + E) float32, m: horizontal, to the UEs in order, then L, then the
          eavesdroppers.
        - ``off_map`` (H,) bool: the last flight would have left the map and was turned back.
        - ``fading`` float32, only where asked for: the factors of unit mean by which the slot's
          fading multiplied the path gains of all links, in the order that
          :class:`hyuav.physics.channel.LinkRow` gives them and ``unflatten`` names.
        - ``ue_positions`` (U, 2), ``legitimate_position`` (2,) and ``eavesdropper_positions``
          (E, 2) float32, m, only where layouts are drawn: of the episode.
        - ``diagnostics``, only where asked for, see :mod:`hyuav.envs.diagnostics`.
        - what ``entries`` names, and ``sum_rate`` (1,) where the reward is another.

    Action:
        - ``action`` (H, 2) float32 in [-1, 1]: the velocity in units of v_max. It is clipped, then
          shortened to the speed limit and to the helper's energy budget. With ``power_control``
          (H, 3): the last number is the power, from the least (-1) to the nominal (1), in dB.

    Reward:
        - ``reward`` (1,) float32, bps/Hz: the secrecy sum-rate of the slot (eq. 6), before any
          penalty; or what ``reward`` says.

    Termination: never.

    A reset that is given ``position`` (H, 2) starts there, otherwise at ``helper_starts``. Where
    layouts are drawn, it draws one for each row that it resets.

    Args:
        scenario: node positions and parameters, the name of a preset, or UE positions such as
            :func:`hyuav.disk` draws; or a list of these, one for each row of the batch's first
            dimension, which differ in positions only. Or what draws layouts anew at each reset,
            such as a :class:`hyuav.LayoutFamily`.
        scheme: "hybrid", "relay", "jamming", or a letter r or j for each helper; or one of these
            for each row of the batch's first dimension.
        batch_size: of the helpers flown at once; where it is left out, a row for each scenario of
            a list.
        device: of all tensors.
        seed: of the fading, the tasks and the layouts; the same seed gives the same episode,
            whether or not diagnostics are asked for. Or one for each row of the batch's first
            dimension, whose numbers then depend on its own seed alone: rows of equal seeds are
            equally lucky.
        diagnostics: compute the ``diagnostics`` entry too.
        fading: give the ``fading`` entry too.
        reward: what a slot earns, a function of its outcome, or the name of one; see
            :class:`hyuav.Reward`. A transform is for :func:`hyuav.make_env`.
        entries: names of :data:`hyuav.envs.reward.ENTRIES`, properties of the slot's outcome that
            are given beside: a number for each slot (1,), helper (H,) or UE (U,).

    Raises:
        InputError: (a ``ValueError``) an unknown preset, scheme, reward or device, a negative seed,
            scenarios that differ in more than positions, a reward that gives other than numbers.
        InputTypeError: (also a ``TypeError``) an argument of the wrong type.

    Example:
        >>> env = SecureOffloadingEnv(Scenario.preset("two_clusters"), batch_size=(4,), seed=0)
        >>> env.rollout(5)["next", "reward"].shape
        torch.Size([4, 5, 1])
    """

    def __init__(
        self,
        scenario: ScenarioLike | Sequence[ScenarioLike] | LayoutGenerator,
        scheme: str | Sequence[str] = "hybrid",
        batch_size: int | Sequence[int] = (),
        device: torch.device | str | None = None,
        seed: int | Sequence[int] | None = None,
        diagnostics: bool = False,
        fading: bool = False,
        reward: Reward | Source | str = SUM_RATE,
        entries: Sequence[str] = (),
    ) -> None:
        generator = scenario if isinstance(scenario, LayoutGenerator) else None
        if generator is not None:
            require_layouts(generator)
        fixed = scenario if generator is None else generator.scenario
        scenarios, batch = as_scenarios(fixed, batch_size)
        super().__init__(device=as_device(device), batch_size=batch)
        self.scenarios, self.generator = scenarios, generator
        self.physics = Physics(
            self.scenarios[0],
            self.device,
            nodes=self._layout(),
            layout_is_known=generator is None,
        )
        self.schemes = as_schemes(scheme, self.batch_size, self.scenario.num_helpers)
        self.diagnostics = checked(bool, "diagnostics", diagnostics)
        self.tells_fading = checked(bool, "fading", fading)
        self.reward = self._checked_reward(as_reward(reward))
        beside = () if self.reward == DEFAULT else (SUM_RATE,)
        self._entries = tuple(dict.fromkeys((*entries, *beside)))
        rules = ModeRule.of(self.schemes, self.scenario.num_helpers, self.device)
        self._mode_rule = rules.each(self._per_row)
        norm_limit = self.physics.norm_limit(self.schemes)
        self._norm_limit = None
        if norm_limit is not None:
            self._norm_limit = self._per_row(norm_limit).unsqueeze(-1)
        self._make_specs()
        self.recorder = FlightRecorder(1, self.scenario.num_slots)
        """Of the flights that :meth:`render` draws."""
        self.draws: Draws
        self._set_seed(seed)

    def _checked_reward(self, reward: Reward) -> Reward:
        """A function, of which it is known now what it depends on."""
        if reward == DEFAULT:
            return reward
        if reward.is_transform:
            accepted = f"{FUNCTION} (a transform is for make_env)"
            raise InputError(rejection("reward", reward.name, accepted))
        depends_on = reward.dependence(self.scenario, self.device)
        return dataclasses.replace(reward, depends_on=depends_on)

    def _layout(self) -> Nodes:
        """Where the nodes are before the first slot, in each row where the rows differ."""
        layouts = [Nodes.of(scenario, self.device) for scenario in self.scenarios]
        return layouts[0] if len(layouts) == 1 else Nodes.in_rows(layouts, len(self.batch_size))

    @property
    def scenario(self) -> Scenario:
        """The scenario that is flown; where rows or episodes differ in positions, one of them."""
        return self.physics.scenario

    @property
    def draws_tasks(self) -> bool:
        """Whether a slot's tasks are drawn: for diagnostics, or because the edge may be full."""
        return self.diagnostics or self.physics.edge_can_saturate

    def _per_row(self, values: Tensor) -> Tensor:
        """Rows of values (1, k) or (rows, k), shaped to broadcast against (*batch_size, k)."""
        if values.shape[0] == 1:
            return values[0]
        inner = len(self.batch_size) - 1
        return values.reshape(-1, *(1,) * inner, values.shape[-1])

    def _make_specs(self) -> None:
        batch, half, device = self.batch_size, self.scenario.map_side / 2, self.device
        num_helpers = self.scenario.num_helpers
        num_targets = self.scenario.num_ues + 1 + self.scenario.num_eavesdroppers

        def flags(*shape: int) -> Binary:
            return Binary(shape[-1], (*batch, *shape), dtype=torch.bool, device=device)

        def numbers(*shape: int) -> Unbounded:
            return Unbounded((*batch, *shape), dtype=torch.float32, device=device)

        def bounded(bound: float, *shape: int) -> Bounded:
            return Bounded(-bound, bound, (*batch, *shape), dtype=torch.float32, device=device)

        self.observation_spec = Composite(
            position=bounded(half, num_helpers, 2),
            mode=Categorical(2, (*batch, num_helpers), dtype=torch.int64, device=device),
            distances=numbers(num_helpers, num_targets),
            off_map=flags(num_helpers),
            shape=batch,
            device=device,
        )
        for name, values in self.node_entries(self.physics.nodes).items():
            self.observation_spec[name] = bounded(half, *values.shape)
        if self.tells_fading:
            self.observation_spec["fading"] = numbers(self.physics.link_row.size)
        shapes = {"slot": (1,), "helper": (num_helpers,), "ue": (self.scenario.num_ues,)}
        for name in self._entries:
            require_choice("entry", name, ENTRIES)
            make = flags if name == "offloading" else numbers
            self.observation_spec[name] = make(*shapes[ENTRIES[name]])
        if self.diagnostics:
            self.observation_spec["diagnostics"] = diagnostics_spec(batch, self.scenario, device)
        # What a step reads besides the action; a reset may be given it too.
        self.state_spec = Composite(
            {
                name: self.observation_spec[name].clone()
                for name in ("position", *self.node_entries(self.physics.nodes))
            },
            shape=batch,
            device=device,
        )
        if self.diagnostics:
            edge_load = self.observation_spec["diagnostics", "edge_load"].clone()
            self.state_spec["diagnostics"] = Composite(
                edge_load=edge_load, shape=batch, device=device
            )
        self.action_spec = bounded(1.0, num_helpers, self.scenario.action_size)
        self.reward_spec = numbers(1)
        self.done_spec = Composite(done=flags(1), terminated=flags(1), shape=batch, device=device)

    def _set_seed(self, seed: int | Sequence[int] | None) -> None:
        given = plain(seed)
        several = isinstance(given, tuple)
        own = as_seeds(given, self.batch_size) if several else as_seed(given)
        size = 0 if self.generator is None else self.generator.size
        self.draws = Draws(self.physics, self.batch_size, own, size)

    def render(self, row: int = 0) -> NDArray[np.uint8]:
        """Draw the map and the flight since the last reset, (height, width, 3).

        Args:
            row: of the batch; only the first is kept, unless :attr:`recorder` keeps more.

        Raises:
            InputError: there was no reset yet.
        """
        from hyuav.envs.rendering import render_frame  # with matplotlib, which takes its time

        alike = len(self.scenarios) == 1
        own = self.scenario if alike else self.scenarios[row // self.batch_size[1:].numel()]
        flight = self.recorder.flight(row)
        own = dataclasses.replace(own, **self.recorder.nodes(row))
        return render_frame(own, *flight)

    def _reset(self, tensordict: TensorDictBase | None, **_: Any) -> TensorDictBase:
        position = self.start(tensordict)
        # What is found at the start is what a slot brings in which the helpers stay there.
        staying = Control(torch.zeros_like(position), self._mode_rule)
        observed = self._slot(self._nodes(self.drawn_layouts(), position), staying)[0]
        if self.diagnostics:
            observed["diagnostics"] = self.observation_spec["diagnostics"].zero()
        after_reset = TensorDict(observed, self.batch_size, device=self.device)
        chosen = None if tensordict is None else tensordict.get("_reset", None)
        self.recorder.start(after_reset, chosen)
        return after_reset

    def start(self, tensordict: TensorDictBase | None) -> Tensor:
        """Where a reset that is given ``tensordict`` puts the helpers: (*batch_size, H, 2) m."""
        position = None if tensordict is None else tensordict.get("position", None)
        if position is None:
            starts = self.physics.nodes.helper
            return starts.expand(*self.batch_size, *starts.shape[-2:]).clone()
        return self._checked_position(position)

    def drawn_layouts(self) -> dict[str, Tensor]:
        """The nodes of episodes that begin now, by their entries; none where they are fixed."""
        if self.generator is None:
            return {}
        entries = self.node_entries(self.generator.draw(self.draws.layouts()))
        shapes = {name: self.observation_spec[name].shape for name in entries}
        return {name: values.float().expand(shapes[name]) for name, values in entries.items()}

    def node_entries(self, nodes: Nodes) -> dict[str, Tensor]:
        """What is told of nodes that do not fly, by entry: all where they are drawn, or nothing."""
        if self.generator is None:
            return {}
        return dict(zip(NODES, (nodes.ue, nodes.legitimate, nodes.eavesdropper), strict=True))

    def _nodes(self, entries: Mapping[str, Tensor] | TensorDictBase, position: Tensor) -> Nodes:
        """All nodes of a slot, with the helpers at ``position``."""
        if self.generator is None:
            return self.physics.nodes._replace(helper=position)
        ue, legitimate, eavesdropper = (entries[name] for name in NODES)
        return Nodes(ue, legitimate, position, eavesdropper)

    def _checked_position(self, position: Tensor) -> Tensor:
        half = self.scenario.map_side / 2
        require_shape("position", position, self.state_spec["position"].shape)
        position = position.to(self.device, torch.float32, copy=True)
        outside = ~(position.abs() <= half).all(dim=-1)
        if bool(outside.any()):
            accepted = f"a position on the map, x and y in [{-half:g}, {half:g}] m"
            raise InputError(rejection("position", position[outside][0].tolist(), accepted))
        return position

    def _step(self, tensordict: TensorDictBase) -> TensorDictBase:
        position, action = tensordict["position"], tensordict["action"]
        require_shape("action", action, (*position.shape[:-1], self.scenario.action_size))
        if action.is_complex():
            raise InputTypeError(rejection("action", action.dtype, "real numbers"))
        action = action.to(torch.float32)  # as specified, whatever is given
        control = self.physics.control(action, self._norm_limit, self._mode_rule)
        entries, outcome, tasks = self._slot(self._nodes(tensordict, position), control)
        entries["reward"] = self.reward.of(outcome).to(outcome.sum_rate.dtype)
        entries["done"] = torch.zeros_like(outcome.taken[0])  # (..., 1) bool, too
        entries["terminated"] = torch.zeros_like(outcome.taken[0])
        if self.diagnostics:
            assert tasks is not None
            edge_load = tensordict["diagnostics", "edge_load"]
            entries["diagnostics"] = diagnose(self.scenario, outcome, tasks, edge_load)
        after = TensorDict(entries, self.batch_size, device=self.device)
        if isinstance(self.draws, Draws):  # else a graph is recorded, and nothing is flown
            self.recorder.add(after)
        return after

    def _slot(
        self, nodes: Nodes, control: Control
    ) -> tuple[dict[str, Any], SlotOutcome, Tasks | None]:
        """Fly one slot: what is observed, what the slot brought, and its tasks."""
        fading = self.draws.fading()
        tasks = self.draws.tasks() if self.draws_tasks else None
        links = None if fading is None else self.physics.link_row.unflatten(fading)
        outcome = slot(self.physics, nodes, control, links, tasks)
        observed: dict[str, Any] = {
            "position": outcome.nodes.helper,
            "mode": outcome.relays.to(torch.int64),
            "distances": outcome.distances,
            "off_map": outcome.off_map,
            **self.node_entries(outcome.nodes),
            **{name: getattr(outcome, name) for name in self._entries},
        }
        if self.tells_fading:
            observed["fading"] = self.observation_spec["fading"].one() if fading is None else fading
        return observed, outcome, tasks
