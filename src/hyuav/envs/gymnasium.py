"""The environment through Gymnasium: one helper, or a native batch of them."""

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
import torch
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

from hyuav._support.errors import InputError, brief, rejection
from hyuav._support.parameters import Count, checked
from hyuav.envs.arguments import as_seed
from hyuav.envs.flights import (
    RENDERING,
    Flags,
    Flights,
    Floats,
    Limited,
    accepted_options,
    limit_of_make,
    limited,
    require_options,
    with_masks,
)
from hyuav.envs.transforms import make_env
from hyuav.physics.generators import LayoutGenerator
from hyuav.physics.scenario import ScenarioLike


class SecureOffloadingGymEnv(Limited, gymnasium.Env[Floats, Floats]):
    """One helper as a Gymnasium environment, ``hyuav/SecureOffloading-v0``.

    It is :func:`hyuav.make_env` for a single helper; U is the number of UEs.

    Observation: (U + 5,) float32, with a clock (U + 6,).
        - x and y of the helper in half sides of the map, in [-1, 1].
        - the mode: 1 relay, -1 jamming; after a reset, the mode at the start position.
        - the horizontal distances to the UEs in order, L and E, minus one half side, in half
          sides: from -1 to sqrt(8) - 1.
        - the clock, from -1 (no slot flown) to 1 (all).

    Action: (2,) float32 in [-1, 1], the velocity in units of v_max; clipped.

    Reward: the secrecy sum-rate of the slot (eq. 6) less the off-map penalty, bps/Hz; or what
    ``reward`` says, less the penalty.

    Truncation: after T slots, ``spec.max_episode_steps``. Termination: never.

    Info:
        - ``position`` (2,) float32, m.
        - ``mode``: 1 relay, 0 jamming.
        - ``off_map``: the last flight would have left the map and was turned back.
        - ``secrecy_sum_rate``, bps/Hz, before the penalty; 0 after a reset.
        - ``diagnostics`` with the entries of :mod:`hyuav.envs.diagnostics` and ``fading`` as in
          :class:`hyuav.SecureOffloadingEnv`, arrays, only where asked for.

    Reset options: ``position`` (2,) m, where to start instead of at ``helper_starts[0]``.

    ``reset(seed=s)`` starts the random numbers that ``make_env(seed=s)`` would draw; without a
    seed, they go on.

    Args:
        scenario: node positions and parameters, or the name of a preset; or what draws a layout
            anew in each episode, such as a :class:`hyuav.LayoutFamily`.
        scheme: "hybrid", "relay" or "jamming".
        max_episode_steps: T, instead of the scenario's ``num_slots``. ``gymnasium.make`` takes it
            too.
        device: where to compute; observations are NumPy arrays on any device.
        render_mode: "rgb_array" for :meth:`render` to draw the map, or None.
        options: all else that :func:`hyuav.make_env` takes, such as ``clock``, ``geofence`` and
            ``diagnostics``.

    Raises:
        InputError: (a ``ValueError``) an argument, action or reset option that is not accepted.
        ResetNeeded: a step before the first reset or after the end of an episode.

    Example:
        >>> env = gymnasium.make("hyuav/SecureOffloading-v0", scenario="two_clusters")
        >>> observation, info = env.reset(seed=0)
        >>> observation.shape, info["position"]
        ((15,), array([-60., -60.], dtype=float32))
    """

    metadata: dict[str, Any] = RENDERING

    def __init__(
        self,
        scenario: ScenarioLike | LayoutGenerator = "two_clusters",
        scheme: str = "hybrid",
        *,
        max_episode_steps: int | None = None,
        device: torch.device | str | None = None,
        render_mode: str | None = None,
        **options: Any,
    ) -> None:
        limit = limit_of_make(self) if max_episode_steps is None else max_episode_steps
        require_options(options)
        seed = int(self.np_random.integers(2**63))
        env = make_env(limited(scenario, limit), scheme, (), device, seed, **options)
        self._flights = Flights(env, render_mode)
        self._ended = False
        self.observation_space, self.action_space = self._flights.spaces()
        self.render_mode = render_mode

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Floats, dict[str, Any]]:
        """Start an episode; see the class for the ``options``."""
        chosen = accepted_options(options, ("position",))
        seed = None if seed is None else as_seed(seed)
        super().reset(seed=seed)
        self._flights.reset(seed, chosen.get("position"), None)
        self._ended = False
        return self._flights.observation(), self._info(np.zeros((), np.float32))

    def step(self, action: ArrayLike) -> tuple[Floats, float, bool, bool, dict[str, Any]]:
        """Fly one slot."""
        if self._ended:
            raise ResetNeeded("the episode has ended: call reset() before step()")
        reward, sum_rate, truncated = self._flights.step(action)
        self._ended = truncated.item()
        observation, info = self._flights.observation(), self._info(sum_rate)
        return observation, reward.item(), False, self._ended, info

    def render(self) -> NDArray[np.uint8] | None:
        """The map and the flight up to now, (height, width, 3); None without a render mode."""
        return None if self.render_mode is None else self._flights.frame()

    def _info(self, secrecy_sum_rate: Floats) -> dict[str, Any]:
        entries = self._flights.info(secrecy_sum_rate)
        return {
            name: entry.item() if isinstance(entry, np.ndarray) and not entry.ndim else entry
            for name, entry in entries.items()
        }


class SecureOffloadingVectorEnv(Limited, VectorEnv[Floats, Floats, NDArray[Any]]):
    """N helpers flown as one batch, what ``gymnasium.make_vec("hyuav/SecureOffloading-v0")`` makes.

    Every entry is that of :class:`SecureOffloadingGymEnv` with N in front, and every entry of
    ``info`` has a mask, ``info["_position"]`` (N,) for instance: the rows that it holds for.

    What happens to a row that has flown its T slots is Gymnasium's ``autoreset_mode``:

        - ``NEXT_STEP``: its next step resets it. That step's action is ignored and its reward 0.
        - ``SAME_STEP``: the step that ends it resets it. The observation and ``info`` returned are
          then those of the reset; ``info["final_obs"]`` (N, U + 5) and ``info["final_info"]`` hold
          what the last slot brought, in the rows where ``info["_final_obs"]`` is true.
        - ``DISABLED``: it is to be reset by ``reset_mask`` before the next step.

    Reset options: ``position`` (2,) or (N, 2) m; and ``reset_mask`` (N,) bool, the rows to reset
    while the others fly on.

    ``reset(seed=s)`` lets all rows draw from one stream of random numbers, that of
    ``make_env(batch_size=N, seed=s)``. ``reset(seed=[s0, s1, ...])`` gives each row its own, so
    that it flies through the same fading as a single environment with that seed. Rows whose seed is
    None or which are not reset then go on with other numbers.

    Args:
        num_envs: N.
        scenario: as for :class:`SecureOffloadingGymEnv`, like the following; or a list of
            scenarios, one for each row.
        scheme: or one for each row.
        autoreset_mode: a mode, or its value: "NextStep", "SameStep" or "Disabled".
        max_episode_steps: T, instead of the scenario's ``num_slots``.
        device: where to compute.
        render_mode: "rgb_array" for :meth:`render` to draw each row's map, or None.
        options: all else that :func:`hyuav.make_env` takes.

    Raises:
        InputError: (a ``ValueError``) an argument, action or reset option that is not accepted.
        ResetNeeded: a step before the first reset or, without autoreset, of a row that has ended.
    """

    metadata: dict[str, Any] = RENDERING | {"autoreset_mode": AutoresetMode.NEXT_STEP}

    def __init__(
        self,
        num_envs: int = 1,
        scenario: ScenarioLike | Sequence[ScenarioLike] | LayoutGenerator = "two_clusters",
        scheme: str | Sequence[str] = "hybrid",
        *,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        max_episode_steps: int | None = None,
        device: torch.device | str | None = None,
        render_mode: str | None = None,
        **options: Any,
    ) -> None:
        num_envs = checked(Count, "num_envs", num_envs)
        self._autoreset_mode = _as_mode(autoreset_mode)
        self.metadata = RENDERING | {"autoreset_mode": self._autoreset_mode}
        require_options(options)
        seed = int(self.np_random.integers(2**63))
        scenario = limited(scenario, max_episode_steps)
        env = make_env(scenario, scheme, num_envs, device, seed, **options)
        self._flights = Flights(env, render_mode)
        self._ended = np.zeros(num_envs, bool)
        self.num_envs = num_envs
        self.single_observation_space, self.single_action_space = self._flights.spaces()
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.render_mode = render_mode

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Floats, dict[str, Any]]:
        """Start episodes; see the class for ``seed`` and ``options``."""
        chosen = accepted_options(options, ("position", "reset_mask"))
        if (mask := chosen.get("reset_mask")) is not None:
            mask = self._checked_mask(mask)
        started = np.ones(self.num_envs, bool) if mask is None else mask
        own: int | list[int] | None
        if seed is None or isinstance(seed, Sequence | np.ndarray):
            own = None if seed is None else self._checked_seeds(seed, started)
        else:
            own = as_seed(seed)
            super().reset(seed=own)
        self._flights.reset(own, chosen.get("position"), mask)
        self._ended = self._ended & ~started
        info = self._flights.info(np.zeros(self.num_envs, np.float32))
        return self._flights.observation(), with_masks(info, started)

    def step(
        self, actions: ArrayLike
    ) -> tuple[Floats, NDArray[Any], NDArray[Any], NDArray[Any], dict[str, Any]]:
        """Fly one slot in every row, but for those that start anew instead."""
        mode, starting, final = self._autoreset_mode, self._ended, {}
        if mode is AutoresetMode.DISABLED and starting.any():
            rows = brief(np.flatnonzero(starting).tolist())
            raise ResetNeeded(f"rows {rows} have ended: reset them by reset_mask before step()")
        terminated = np.zeros(self.num_envs, bool)
        if starting.all():  # then nobody flies
            observation, infos = self.reset()
            reward = np.zeros(self.num_envs, np.float32)
            return observation, reward, terminated, terminated.copy(), infos
        reward, sum_rate, truncated = self._flights.step(actions)
        if mode is AutoresetMode.NEXT_STEP:
            truncated = truncated & ~starting
            reward = np.where(starting, np.float32(0.0), reward)
        elif mode is AutoresetMode.SAME_STEP and truncated.any():
            starting, info = truncated, with_masks(self._flights.info(sum_rate), truncated)
            ended = {"final_obs": self._flights.observation(), "final_info": info}
            final = ended | {f"_{name}": truncated.copy() for name in ended}
        if starting.any():
            self._flights.reset(None, None, starting)
            sum_rate = np.where(starting, np.float32(0.0), sum_rate)
        self._ended = truncated & (mode is not AutoresetMode.SAME_STEP)
        infos = with_masks(self._flights.info(sum_rate), np.ones(self.num_envs, bool)) | final
        return self._flights.observation(), reward, terminated, truncated, infos

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """Each row's map and flight up to now; None without a render mode."""
        if self.render_mode is None:
            return None
        return tuple(self._flights.frame(row) for row in range(self.num_envs))

    def _checked_mask(self, mask: ArrayLike) -> Flags:
        rows = np.asarray(mask)
        if rows.shape != (self.num_envs,) or rows.dtype != np.bool_ or not rows.any():
            accepted = f"shape {(self.num_envs,)} of true and false, at least one of them true"
            raise InputError(rejection("reset_mask", mask, accepted))
        return rows

    def _checked_seeds(
        self, seeds: Sequence[int | None] | NDArray[Any], started: Flags
    ) -> list[int] | None:
        """A seed for each row: a new one where none is given or the row flies on."""
        if len(seeds) != self.num_envs:
            accepted = f"one number, or one for each of {self.num_envs} rows"
            raise InputError(rejection("seed", seeds, accepted))
        given = [None if seed is None else as_seed(seed) for seed in seeds]
        if all(seed is None for seed in given):
            return None
        others = self.np_random.integers(2**63, size=self.num_envs).tolist()
        return [
            other if seed is None or not starts else seed
            for seed, other, starts in zip(given, others, started, strict=True)
        ]


def _as_mode(mode: AutoresetMode | str) -> AutoresetMode:
    try:
        return AutoresetMode(mode)
    except ValueError:
        values = ", ".join(own.value for own in AutoresetMode)
        accepted = f"an AutoresetMode of gymnasium.vector, or one of {values}"
        raise InputError(rejection("autoreset_mode", mode, accepted)) from None
