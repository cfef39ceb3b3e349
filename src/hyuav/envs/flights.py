"""Flights told in NumPy's terms: what Gymnasium's two kinds of environment share."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import torch
from gymnasium.error import ResetNeeded
from gymnasium.spaces import Box, Space
from numpy.typing import ArrayLike, NDArray
from tensordict import TensorDict, TensorDictBase
from torchrl.envs import TransformedEnv

from hyuav._support.errors import InputError, InputTypeError, rejection, require_choice
from hyuav.envs.rendering import FlightRecorder
from hyuav.envs.rewards import sum_rate_of
from hyuav.physics.scenario import Scenario

Floats = NDArray[np.float32]
Flags = NDArray[np.bool_]

RENDERING: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 4}


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
        self._recorder = None if render_mode is None else FlightRecorder(self.scenario)

    @property
    def state(self) -> TensorDictBase:
        """What the next slot starts from."""
        if self._state is None:
            raise ResetNeeded("call reset() before step() and render()")
        return self._state

    def spaces(self) -> tuple[Space[Any], Space[Any]]:
        """One helper's observation and action space.

        A distance is at most the map's diagonal, sqrt(8) of the half sides it is measured in.
        """
        layout = self.env.transform[-1].layout
        high = torch.ones(layout.size)
        layout.distances(high).fill_(math.sqrt(8.0) - 1.0 + 1e-5)  # float32 rounding
        observed = Box(np.full(layout.size, -1.0, np.float32), high.numpy(), dtype=np.float32)
        return observed, Box(-1.0, 1.0, (layout.action_size,), np.float32)

    def reset(self, seed: int | None, position: ArrayLike | None, mask: Flags | None) -> None:
        """Start anew at ``position`` (2,) or (*B, 2) m, only in the rows of ``mask`` (*B,)."""
        if seed is not None:
            self.env.set_seed(seed, static_seed=True)
        shape = (*self.env.batch_size, 2)
        start = self.env.base_env.start(None)
        if position is not None:
            given = _as_tensor("position", position, ((2,), shape), self.env.device)
            start = given.expand(shape).unsqueeze(-2)
        if mask is None:
            entries = TensorDict(position=start, batch_size=self.env.batch_size)
        else:
            rows = torch.tensor(mask, device=self.env.device).unsqueeze(-1)
            entries = self.state.copy()
            entries["position"] = torch.where(rows.unsqueeze(-1), start, entries["position"])
            entries["_reset"] = rows
            if self._recorder is not None:
                self._recorder.drop_last()
        self._enter(self.env.reset(entries))

    def step(self, action: ArrayLike) -> tuple[Floats, Floats, Flags]:
        """Fly one slot by ``action`` (*B, 2): reward, secrecy sum-rate and truncation, (*B,)."""
        state = self.state.copy()
        shape = (*self.env.batch_size, 2)
        state["action"] = _as_tensor("action", action, (shape,), self.env.device)
        flown = self.env.step(state)
        after = flown["next"]
        sum_rate = sum_rate_of(after, self.scenario.off_map_penalty)
        self._enter(self.env.step_mdp(flown))
        return _column(after["reward"]), _column(sum_rate), _column(after["truncated"])

    def observation(self) -> Floats:
        """The normalized observation: (*B, observed)."""
        return self.state["observation"].numpy(force=True)

    def info(self, secrecy_sum_rate: Floats) -> dict[str, NDArray[Any]]:
        """The entries of ``info``, arrays of leading shape B; ``secrecy_sum_rate`` is (*B,)."""
        return {
            # Copied because the caller may write to it, and the next slot starts from it.
            "position": self._position().copy(),
            "mode": _column(self.state["mode"]),
            "off_map": _column(self.state["off_map"]),
            "secrecy_sum_rate": secrecy_sum_rate,
        }

    def frame(self, row: tuple[int, ...] = ()) -> NDArray[np.uint8]:
        """A picture of one row's flight up to now; needs a render mode."""
        assert self._recorder is not None
        return self._recorder.frame(int(self.state["step_count"][row]), row)

    def _enter(self, state: TensorDictBase) -> None:
        self._state = state
        if self._recorder is not None:
            self._recorder.add(self._position(), _column(state["mode"]))

    def _position(self) -> Floats:
        """Where the helper is: (*B, 2) m."""
        return self.state["position"].squeeze(-2).numpy(force=True)


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


def _as_tensor(
    name: str, value: ArrayLike, shapes: Sequence[tuple[int, ...]], device: torch.device
) -> torch.Tensor:
    accepted = f"finite numbers of shape {' or '.join(map(str, dict.fromkeys(shapes)))}"
    try:
        array = np.asarray(value, dtype=np.float32)
    except (TypeError, ValueError):
        raise InputTypeError(rejection(name, value, accepted)) from None
    if array.shape not in shapes or not np.isfinite(array).all():
        raise InputError(rejection(name, value, accepted))
    return torch.tensor(array, device=device)


def _column(values: torch.Tensor) -> NDArray[Any]:
    """(*B, 1) to (*B,)."""
    return values.squeeze(-1).numpy(force=True)
