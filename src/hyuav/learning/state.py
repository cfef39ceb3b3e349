"""Whether what a checkpoint holds is the state of a cohort like the one that takes it up.

PyTorch and TorchRL accept much that fails only later, in the middle of an episode. So every entry
is compared with that of the cohort before any is taken.
"""

from collections.abc import Collection
from typing import TYPE_CHECKING, Any

import torch
from torch import Tensor

from hyuav._support.errors import InputError, InputTypeError, brief, rejection
from hyuav._support.parameters import count, number

if TYPE_CHECKING:
    from hyuav.learning.train import Cohort

counted = count(0, 2**53)
"""Accept how many episodes, updates or draws there were: all float64 can tell apart."""

BEGIN = ("step_count", "done", "terminated", "truncated")
"""Zero where a flight begins, as between two episodes."""


def require_entries(name: str, value: Any, expected: Collection[Any]) -> None:
    """Accept a dict of these keys.

    Raises:
        InputError: naming the first that is missing or too many.
    """
    if not isinstance(value, dict):
        raise InputTypeError(rejection(name, value, "names with values"))
    for key in expected:
        if key not in value:
            raise InputError(f"{name}: {brief(key)} is missing")
    for key in value:
        if key not in expected:
            raise InputError(f"{name}: unknown entry {brief(key)}")


def require_like(name: str, value: Any, example: Any) -> None:
    """Accept what is built as the example: tensors of its shapes and types, and all else equal.

    Raises:
        InputError: naming the entry.
    """
    if isinstance(example, Tensor):
        _require_tensor(name, value, example.dtype, [example.shape])
    elif isinstance(example, dict):
        require_entries(name, value, example)
        for key, own in example.items():
            require_like(f"{name}.{key}", value[key], own)
    elif type(value) is not type(example):
        raise InputTypeError(rejection(name, value, brief(example)))
    elif isinstance(example, list | tuple) and len(value) == len(example):
        for index, (given, own) in enumerate(zip(value, example, strict=True)):
            require_like(f"{name}[{index}]", given, own)
    elif value != example:
        raise InputError(rejection(name, value, brief(example)))


def with_own_memory(value: Any) -> Any:
    """A copy in which no two numbers share memory, in dicts, lists and tuples; it is written to."""
    if isinstance(value, Tensor):
        return value.clone()
    if isinstance(value, dict):
        return {key: with_own_memory(own) for key, own in value.items()}
    if isinstance(value, list):
        return [with_own_memory(own) for own in value]
    return value


def require_state(name: str, state: Any, cohort: "Cohort") -> None:
    """Accept what :meth:`Cohort.state_dict` gave of a cohort made with the same arguments.

    Args:
        name: of the state.
        state: to go on from.
        cohort: that would go on from it; it is left as it is.

    Raises:
        InputError: naming the entry.
    """
    example = cohort.state_dict()
    require_entries(name, state, example)
    for part in ("modules", "best_evaluation", "best_weights", "stopped"):
        require_like(f"{name}.{part}", state[part], example[part])
    episode = counted(f"{name}.episode", state["episode"])
    counted(f"{name}.updates", state["updates"])
    stopped, best = state["stopped"], state["best_evaluation"]
    flown = episode * cohort.scenario.num_slots
    if not ((stopped >= 0) & (stopped <= flown)).all():
        raise InputError(f"{name}.stopped: expected slots up to {flown}")
    if not (best < torch.inf).all():
        raise InputError(f"{name}.best_evaluation: expected finite numbers, or minus infinity")
    for key, weights in state["best_weights"].items():
        _require_finite(f"{name}.best_weights.{key}", weights)
    _require_draws(f"{name}.environment", state["environment"], example["environment"])
    require_entries(f"{name}.random", state["random"], example["random"])
    for key, stream in example["random"].items():
        _require_draws(f"{name}.random.{key}", state["random"][key], stream)
    optimizers = [step.optimizer for step in cohort.algorithm.steps]
    if not isinstance(state["optimizers"], list) or len(state["optimizers"]) != len(optimizers):
        raise InputError(f"{name}.optimizers: expected a list of {len(optimizers)}")
    for index, optimizer in enumerate(optimizers):
        _require_optimizer(f"{name}.optimizers[{index}]", state["optimizers"][index], optimizer)
    _require_replay(f"{name}.replay", state["replay"], example["replay"], cohort)
    _require_slot(f"{name}.slot", state["slot"], cohort)


def _require_tensor(
    name: str, value: Any, dtype: torch.dtype, shapes: Collection[tuple[int, ...]]
) -> None:
    accepted = f"{dtype} of shape {' or '.join(str(tuple(shape)) for shape in shapes)}"
    if not isinstance(value, Tensor):
        raise InputTypeError(rejection(name, value, accepted))
    plain = value.layout == torch.strided and value.device.type != "meta"
    if not plain or value.requires_grad or value.dtype != dtype or value.shape not in shapes:
        found = f"{value.dtype} of shape {tuple(value.shape)}"
        raise InputError(f"{name} is {found}: expected a plain tensor, {accepted}")


def _require_finite(name: str, values: Tensor) -> None:
    if not values.isfinite().all():
        raise InputError(f"{name}: expected finite numbers")


def _require_draws(name: str, value: Any, example: dict[str, Any]) -> None:
    """Accept where random numbers stand: their keys, and how many have been drawn."""
    require_entries(name, value, example)
    for key, own in example.items():
        if isinstance(own, Tensor):
            require_like(f"{name}.{key}", value[key], own)
        else:
            counted(f"{name}.{key}", value[key])


def _require_optimizer(name: str, value: Any, optimizer: torch.optim.Optimizer) -> None:
    """Accept the state of Adam on the same weights, some of which may have had no step yet."""
    example = optimizer.state_dict()
    require_entries(name, value, example)
    groups = value["param_groups"]
    if not isinstance(groups, list) or len(groups) != len(example["param_groups"]):
        raise InputError(f"{name}.param_groups: expected a list of {len(example['param_groups'])}")
    for index, own in enumerate(example["param_groups"]):
        group = f"{name}.param_groups[{index}]"
        require_entries(group, groups[index], own)
        require_like(group, groups[index], own)
    weights = [weight for group in optimizer.param_groups for weight in group["params"]]
    if not isinstance(value["state"], dict):
        raise InputTypeError(rejection(f"{name}.state", value["state"], "moments by weight"))
    for index, moments in value["state"].items():
        if type(index) is not int or not 0 <= index < len(weights):
            raise InputError(f"{name}.state: unknown entry {brief(index)}")
        like = {"step": torch.zeros(()), "exp_avg": weights[index], "exp_avg_sq": weights[index]}
        require_like(f"{name}.state[{index}]", moments, like)
        number(0.0)(f"{name}.state[{index}].step", moments["step"])


def _require_replay(name: str, value: Any, example: dict[str, Any], cohort: "Cohort") -> None:
    """Accept a buffer of the same size, with what is kept of a slot in it, or with nothing."""
    require_entries(name, value, example)
    own = {key: example[key] for key in example.keys() - {"_storage", "_writer"}}
    require_like(name, {key: value[key] for key in own}, own)
    storage, writer = value["_storage"], value["_writer"]
    require_entries(f"{name}._storage", storage, example["_storage"])
    require_entries(f"{name}._writer", writer, example["_writer"])
    capacity = cohort.replay.storage.max_size
    length = count(0, capacity)(f"{name}._storage._len", storage["_len"])
    count(0, capacity - 1)(f"{name}._writer._cursor", writer["_cursor"])
    counted(f"{name}._writer._write_count", writer["_write_count"])
    stored = storage["_storage"]
    require_like(f"{name}._storage.initialized", storage["initialized"], length > 0)
    if length:
        memory = cohort.algorithm.parameters.memory
        slot = cohort.env.fake_tensordict().select(*memory.names)
        like = slot.expand(capacity, *slot.batch_size)
        require_like(f"{name}._storage._storage", stored, like.flatten_keys(".").to_dict())
        parts: Any = getattr(stored, "_metadata", None)  # by which TensorDict puts them together
        require_entries(f"{name}._storage._storage metadata", parts, ("", "next"))
        for part in parts.values():
            sizes = {"batch_size": like.batch_size, "device": part["device"]}
            require_like(f"{name}._storage._storage metadata", part, sizes)
    else:
        require_entries(f"{name}._storage._storage", stored, ())


def _require_slot(name: str, value: Any, cohort: "Cohort") -> None:
    """Accept a flight that begins, with what the last explorer left beside it."""
    own = cohort.collector._carrier
    names = (*cohort.env.observation_spec.keys(), *cohort.env.done_keys)
    observed = {key: own[key] for key in names}
    left = [str(key) for key in cohort.algorithm.explorer.out_keys]
    if not isinstance(value, dict):
        raise InputTypeError(rejection(name, value, "names with values"))
    require_like(name, {key: value[key] for key in value if key not in left}, observed)
    for key, values in value.items():
        if key in left:
            learners = len(cohort.learners)
            _require_tensor(f"{name}.{key}", values, torch.float32, [(learners, 2), (learners,)])
        if values.is_floating_point():
            _require_finite(f"{name}.{key}", values)
        elif key in BEGIN and values.any():
            raise InputError(f"{name}.{key}: expected zeros, since a flight begins")
