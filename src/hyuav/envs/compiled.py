"""The slots of an environment as one compiled graph, for batches of thousands of helpers."""

import warnings
from collections.abc import Callable
from typing import Any

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor
from torch.fx import Graph, Node
from torch.fx.experimental.proxy_tensor import make_fx
from torchrl.data import Composite
from torchrl.envs import TransformedEnv

from hyuav._support.recording import COMPILATION_ERRORS, compile_graph, has_compiler
from hyuav.envs.arguments import NODES, require_shape
from hyuav.envs.draws import GivenDraws

Flight = Callable[..., tuple[Tensor, ...]]

OPTIONS = {"cpp.enable_floating_point_contract_flag": "fast", "pattern_matcher": False}
"""A product and a sum may be rounded once instead of twice; copies that order memory are kept."""


class CompiledEnv(TransformedEnv):
    """A transformed :class:`SecureOffloadingEnv` whose slots run as one graph.

    Draws, physics and transforms are fused, so that a slot's intermediate results need not
    travel through memory. The graph is compiled in the first step. Its results are those of the
    eager environment up to rounding; where no compiler is found, or it fails, the environment is
    the eager one. Entries lie in memory with the batch last, for the sake of the loops over it.
    """

    _flight: Flight | None = None
    _eager: bool = False

    def _step(self, tensordict: TensorDictBase) -> TensorDictBase:
        if not self._eager and self._flight is None:
            self._compile(tensordict)
        if self._flight is None or not {"next", "_step"}.isdisjoint(tensordict.keys()):
            return super()._step(tensordict)
        after = self._flown(self._flight, tensordict)
        self.base_env.recorder.add(after)
        return after

    def _reset(self, tensordict: TensorDictBase | None = None, **kwargs: Any) -> TensorDictBase:
        partly = tensordict is not None and tensordict.get("_reset", None) is not None
        if self._flight is None or partly or self._own_state:
            return super()._reset(tensordict, **kwargs)
        # What is found at the start is what a slot brings in which the helper stays there.
        before = self.full_state_spec.zero()
        before["position"] = self.base_env.start(tensordict)
        before.update(self.base_env.drawn_layouts())
        before[self.action_key] = self.full_action_spec[self.action_key].zero()
        before["episode_reward"] = self.observation_spec["episode_reward"].zero()
        before["step_count"] = torch.full_like(before["episode_reward"], -1, dtype=torch.int64)
        after = self._flown(self._flight, before).exclude(self.reward_key)
        after["episode_reward"] = before["episode_reward"]
        if self.base_env.diagnostics:
            after["diagnostics"] = self.base_env.observation_spec["diagnostics"].zero()
        self.base_env.recorder.start(after)
        return after

    def set_seed(self, seed: Any = None, static_seed: bool = False) -> Any:
        """Draw from another seed; a graph is dropped if other rows then have a seed in common."""
        before = self.base_env.draws.rows
        following = super().set_seed(seed, static_seed)
        after = self.base_env.draws.rows
        if (before is None) != (after is None) or not (before is None or before.equal(after)):
            self._flight = None
        return following

    def _flown(self, flight: Flight, tensordict: TensorDictBase) -> TensorDictBase:
        env = self.base_env
        ticket = env.draws.ticket(tasks=env.draws_tasks)
        outputs = flight(*self._inputs(tensordict), *ticket)
        return self._entries(self._output_keys, outputs)

    @property
    def _own_state(self) -> list[Any]:
        """What a reward that is a transform keeps from slot to slot; its reset is its own."""
        known = "position", "episode_reward", "step_count", ("diagnostics", "edge_load"), *NODES
        return [key for key in self.full_state_spec.keys(True, True) if key not in known]

    @property
    def _input_keys(self) -> list[Any]:
        keys = ["position", self.action_key, "episode_reward", "step_count", *self._own_state]
        keys += self.base_env.node_entries(self.base_env.physics.nodes)
        return [*keys, ("diagnostics", "edge_load")] if self.base_env.diagnostics else keys

    def _inputs(self, tensordict: TensorDictBase) -> list[Tensor]:
        """The entries (..., *batch_size) that a slot starts from, as the graph reads memory."""
        shape = self.full_action_spec[self.action_key].shape
        require_shape("action", tensordict[self.action_key], shape)
        return [
            self._batch_last(
                tensordict[key].to(torch.int64 if key == "step_count" else torch.float32)
            ).contiguous()
            for key in self._input_keys
        ]

    def _batch_last(self, values: Tensor) -> Tensor:
        """(*batch_size, ...) to (..., *batch_size)."""
        rank = len(self.batch_size)
        return values.permute(*range(rank, values.ndim), *range(rank))

    def _batch_first(self, values: Tensor) -> Tensor:
        """(..., *batch_size) to (*batch_size, ...)."""
        inner = values.ndim - len(self.batch_size)
        return values.permute(*range(inner, values.ndim), *range(inner))

    def _entries(self, keys: list[Any], values: tuple[Tensor, ...]) -> TensorDictBase:
        entries = TensorDict({}, batch_size=self.batch_size, device=self.device)
        for key, value in zip(keys, values, strict=False):
            entries[key] = self._batch_first(value)
        for name, spec in self.observation_spec.items():
            if isinstance(spec, Composite) and name in entries:
                entries[name].batch_size = spec.shape  # of agents, with an axis for them
        return entries

    def _compile(self, tensordict: TensorDictBase) -> None:
        draws = self.base_env.draws
        state = draws.state()
        arguments = [*self._inputs(tensordict), *draws.ticket(tasks=False)]
        draws.set_state(state)
        self._eager = True
        if not has_compiler(self.device):
            return
        try:
            with torch.no_grad(), warnings.catch_warnings():
                warnings.simplefilter("ignore", FutureWarning)  # of settings that it reads
                recorded = make_fx(self._fly)(*arguments)
                _keep_the_batch_last(recorded.graph)
                recorded.recompile()
                flight = compile_graph(recorded, arguments, OPTIONS)
                flight(*arguments)
        except COMPILATION_ERRORS as error:
            warnings.warn(f"slots are not compiled: {error}", stacklevel=2)
            return
        self._flight, self._eager = flight, False

    def _fly(self, *arguments: Tensor) -> tuple[Tensor, ...]:
        """One slot, from and to entries (..., *batch_size)."""
        env, count = self.base_env, len(self._input_keys)
        draws = env.draws
        fading, tasks = draws.redeem(*arguments[count:])
        env.draws = GivenDraws(fading, tasks)
        try:
            after = super()._step(self._entries(self._input_keys, arguments[:count]))
        finally:
            env.draws = draws
        self._output_keys = list(after.keys(include_nested=True, leaves_only=True))
        outputs = [after[key] for key in self._output_keys]
        # What is returned is stored: the fading is drawn once, not again wherever it is used.
        outputs += [] if fading is None else [fading]
        return tuple(
            self._batch_last(values).clone(memory_format=torch.contiguous_format)
            for values in outputs
        )


def _keep_the_batch_last(graph: Graph) -> None:
    """Order intermediate results in memory as the graph's inputs and outputs are: batch last.

    Otherwise some are stored with the batch first, and loops over them are neither vectorized
    nor spread over the processor's cores.
    """
    aten = torch.ops.aten
    (written,) = next(iter(graph.find_nodes(op="output"))).args
    for copy in dict.fromkeys(written):
        _read_as_written(graph, copy)
    for gather in graph.find_nodes(op="call_function", target=aten.cat.default):
        parts, *axis = gather.args
        rank = gather.meta["val"].ndim
        if rank > 1 and axis in ([-1], [rank - 1]):
            order = [rank - 1, *range(rank - 1)]
            with graph.inserting_before(gather):
                rows = [graph.call_function(aten.permute.default, (part, order)) for part in parts]
                gathered = graph.call_function(aten.cat.default, (rows, 0))
                view = graph.call_function(aten.permute.default, (gathered, _inverse(order)))
            gather.replace_all_uses_with(view)
            graph.erase_node(gather)
    graph.lint()


def _read_as_written(graph: Graph, copy: Node) -> None:
    """Let all who read an entry that is written, clone(permute(entry)), read what was written."""
    permute = torch.ops.aten.permute.default
    turned = copy.all_input_nodes[0]
    if turned.target is not permute:
        return
    entry, order = turned.args
    assert isinstance(entry, Node)
    users = [user for user in entry.users if user is not turned]
    if entry.op == "placeholder" or not users:
        return
    entry.append(turned)
    turned.append(copy)
    with graph.inserting_after(copy):
        view = graph.call_function(permute, (copy, _inverse(order)))
    for user in users:
        user.replace_input_with(entry, view)


def _inverse(order: Any) -> list[int]:
    return [order.index(axis) for axis in range(len(order))]
