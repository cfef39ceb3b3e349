"""Flights told in NumPy's terms: what Gymnasium's two kinds of environment share."""

import copy
import math
import sys
from collections.abc import Iterable, Mapping, Sequence
from inspect import signature
from types import FrameType
from typing import Any

import gymnasium
import numpy as np
import torch
from gymnasium.envs import registration
from gymnasium.envs.registration import EnvSpec
from gymnasium.error import ResetNeeded
from gymnasium.spaces import Box
from numpy.typing import ArrayLike, NDArray
from tensordict import TensorDict, TensorDictBase
from torchrl.envs import TransformedEnv

from hyuav._support.errors import InputError, InputTypeError, rejection, require_choice
from hyuav._support.parameters import Count, checked, plain
from hyuav.envs.recorder import FlightRecorder
from hyuav.envs.rewards import sum_rate_of
from hyuav.envs.transforms import make_env
from hyuav.physics.generators import LayoutGenerator, over_horizon
from hyuav.physics.scenario import Scenario, as_scenario, is_layout

Floats = NDArray[np.float32]
Flags = NDArray[np.bool_]

RENDERING: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 4}

WHERE_ASKED_FOR = ("fading", "diagnostics")
"""Entries of the environment that ``info`` holds where the environment has them."""


class Flights:
    """Flights with one helper each: a single one, B = (), or a batch of them, B = (N,).

    Args:
        env: from :func:`hyuav.make_env`, of batch shape B.
        render_mode: "rgb_array" or None.

    Raises:
        InputError: another ``render_mode``.
    """

    def __init__(self, env: TransformedEnv, render_mode: str | None) -> None:
        if render_mode is not None:
            require_choice("render_mode", render_mode, RENDERING["render_modes"])
        self.env = env
        self._state: TensorDictBase | None = None
        self.scenario: Scenario = env.base_env.scenario
        if render_mode is not None:  # of every row, not of the first alone
            env.base_env.recorder = FlightRecorder(env.numel(), self.scenario.num_slots)

    @property
    def state(self) -> TensorDictBase:
        """What the next slot starts from."""
        if self._state is None:
            raise ResetNeeded("call reset() before step() and render()")
        return self._state

    def spaces(self) -> tuple[Box[np.float32], Box[np.float32]]:
        """One helper's observation and action space.

        A distance is at most the map's diagonal, sqrt(8) of the half sides it is measured in.
        """
        layout = self.env.transform[-1].layout
        high = torch.ones(layout.size, dtype=torch.float32, device="cpu")
        layout.distances(high).fill_(math.sqrt(8.0) - 1.0 + 1e-5)  # float32 rounding
        observed = Box(np.full(layout.size, -1.0, np.float32), high.numpy(), dtype=np.float32)
        return observed, Box(-1.0, 1.0, (layout.action_size,), np.float32)

    def reset(
        self, seed: int | list[int] | None, position: ArrayLike | None, mask: Flags | None
    ) -> None:
        """Start anew at ``position`` (2,) or (*B, 2) m, only in the rows of ``mask`` (*B,).

        With several helpers it is (H, 2) or (*B, H, 2).
        """
        if seed is not None:
            self.env.set_seed(seed, static_seed=True)
        start = self.env.base_env.start(None)
        if position is not None:
            one = (2,) if self.scenario.num_helpers == 1 else tuple(start.shape[-2:])
            shape = (*self.env.batch_size, *one)
            given = as_array("position", position, (one, shape))
            start = torch.tensor(given, device=self.env.device).expand(shape).reshape(start.shape)
        if mask is None:
            entries = TensorDict(position=start, batch_size=self.env.batch_size)
        else:
            rows = torch.tensor(mask, device=self.env.device).unsqueeze(-1)
            entries = self.state.copy()
            entries["position"] = torch.where(rows.unsqueeze(-1), start, entries["position"])
            entries["_reset"] = rows
        self._state = self.env.reset(entries)

    def step(self, action: ArrayLike) -> tuple[Floats, Floats, Flags]:
        """Fly a slot by ``action`` (*B, 2 H): reward, secrecy sum-rate and truncation, (*B,)."""
        state = self.state.copy()
        shape = self.env.action_spec.shape
        given = as_array("action", action, (shape,))
        state["action"] = torch.tensor(given, device=self.env.device)
        flown = self.env.step(state)
        after = flown["next"]
        sum_rate = sum_rate_of(after, self.scenario.off_map_penalty)
        self._state = self.env.step_mdp(flown)
        return _column(after["reward"]), _column(sum_rate), _column(after["truncated"])

    def observation(self) -> Floats:
        """The normalized observation: (*B, observed)."""
        return self.state["observation"].clone().numpy(force=True)  # wrappers write to it

    def info(self, secrecy_sum_rate: Floats) -> dict[str, Any]:
        """The entries of ``info``, arrays of leading shape B; ``secrecy_sum_rate`` is (*B,)."""
        names = ("position", "mode", "off_map", *WHERE_ASKED_FOR)
        # Copied because the caller may write to it, and the next slot starts from it.
        told = self.state.select(*names, strict=False).clone()
        return {
            "position": self._of_one(told["position"], -2).numpy(force=True),
            "mode": self._of_one(told["mode"], -1).numpy(force=True),
            "off_map": self._of_one(told["off_map"], -1).numpy(force=True),
            "secrecy_sum_rate": secrecy_sum_rate,
            **{name: _arrays(told[name]) for name in WHERE_ASKED_FOR if name in told},
        }

    def _of_one(self, values: torch.Tensor, axis: int) -> torch.Tensor:
        """Values without the helper's axis where there is one helper."""
        return values.squeeze(axis) if self.scenario.num_helpers == 1 else values

    def frame(self, row: int = 0) -> NDArray[np.uint8]:
        """A picture of one row's flight up to now; only the first has one without a render mode."""
        picture: NDArray[np.uint8] = self.env.base_env.render(row)
        return picture


class Limited:
    """An environment whose spec tells T as its ``max_episode_steps``."""

    _flights: Flights
    _spec: EnvSpec | None = None

    @property
    def spec(self) -> EnvSpec | None:
        """What Gymnasium makes the environment from; None where it has not made it."""
        return self._spec

    @spec.setter
    def spec(self, given: EnvSpec | None) -> None:
        """Keep a copy, whatever limit it tells."""
        self._spec = copy.copy(given)
        if self._spec is not None:
            self._spec.max_episode_steps = self._flights.scenario.num_slots


def limit_of_make(env: gymnasium.Env[Any, Any]) -> int | None:
    """The ``max_episode_steps`` given to the ``gymnasium.make`` that creates ``env`` just now.

    Gymnasium tells it to nobody but a wrapper around the environment, which can make episodes
    shorter but not longer. None where there is none, or the environment is not created so.
    """
    frame: FrameType | None = sys._getframe(1)
    while frame is not None and frame.f_locals.get("self") is env:
        frame = frame.f_back
    if frame is None or frame.f_code is not registration.make.__code__:
        return None
    limit: int | None = frame.f_locals.get("max_episode_steps")
    spec: EnvSpec | None = frame.f_locals.get("env_spec")
    return spec.max_episode_steps if limit is None and spec is not None else limit


def limited(scenario: Any, max_episode_steps: int | None) -> Any:
    """What is flown, or what each row flies, with another T; the same for None and -1.

    Raises:
        InputError: ``max_episode_steps`` is no whole number, or below 1.
    """
    if max_episode_steps is None or max_episode_steps == -1:
        return scenario
    num_slots = checked(Count, "max_episode_steps", max_episode_steps)
    given = plain(scenario)
    if isinstance(given, tuple) and not is_layout(given):
        return [over_horizon(as_scenario(each), num_slots) for each in given]
    whole = given if isinstance(given, LayoutGenerator) else as_scenario(given)
    return over_horizon(whole, num_slots)


def accepted_options(options: object, names: Sequence[str]) -> Mapping[str, Any]:
    """The options of a reset, none where they are None.

    Raises:
        InputError: an option that is not in ``names``, or no mapping.
    """
    if options is None:
        return {}
    if not isinstance(options, Mapping):
        accepted = f"a dictionary with any of {', '.join(names)}"
        raise InputTypeError(rejection("options", options, accepted))
    for name in options:
        require_choice("reset option", name, names)
    return options


def require_options(options: Iterable[str]) -> None:
    """Accept what :func:`hyuav.make_env` takes and the environments here do not set themselves.

    Raises:
        InputError: naming another.
    """
    own = ("scenario", "scheme", "batch_size", "device", "seed", "agents")
    known = [name for name in signature(make_env).parameters if name not in own]
    for name in options:
        require_choice("option", name, known)


def with_masks(entries: Mapping[str, Any], rows: Flags) -> dict[str, Any]:
    """Add to each entry the rows that it holds for, as Gymnasium's vector infos have it."""
    own = {
        name: with_masks(entry, rows) if isinstance(entry, Mapping) else entry
        for name, entry in entries.items()
    }
    return own | {f"_{name}": rows.copy() for name in own}


def as_array(name: str, value: ArrayLike, shapes: Sequence[tuple[int, ...]]) -> Floats:
    """Finite numbers of one of the shapes.

    Raises:
        InputError: they have another shape, or are not finite.
        InputTypeError: something else.
    """
    accepted = f"finite numbers of shape {' or '.join(map(str, dict.fromkeys(shapes)))}"
    try:
        array = np.asarray(value, dtype=np.float32)
    except (TypeError, ValueError):
        raise InputTypeError(rejection(name, value, accepted)) from None
    if array.shape not in shapes or not np.isfinite(array).all():
        raise InputError(rejection(name, value, accepted))
    return array


def _arrays(entry: torch.Tensor | TensorDictBase) -> Any:
    """An entry's array, or those of the entries in it."""
    if isinstance(entry, torch.Tensor):
        return entry.numpy(force=True)
    return {name: _arrays(own) for name, own in entry.items()}


def _column(values: torch.Tensor) -> NDArray[Any]:
    """(*B, 1) to (*B,)."""
    return values.squeeze(-1).numpy(force=True)
