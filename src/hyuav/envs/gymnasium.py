"""The environment through Gymnasium: one helper, or a native batch of them."""

from collections.abc import Mapping, Sequence
from typing import Any

import gymnasium
import numpy as np
import torch
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

from hyuav._support.errors import InputError, rejection
from hyuav._support.parameters import Count, checked
from hyuav.envs.arguments import as_seed
from hyuav.envs.flights import RENDERING, Flags, Flights, Floats, accepted_options
from hyuav.envs.reward import Reward, Source
from hyuav.envs.rewards import SUM_RATE
from hyuav.envs.transforms import make_env
from hyuav.physics.scenario import Scenario


class SecureOffloadingGymEnv(gymnasium.Env[Floats, Floats]):
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

    Truncation: after T slots. Termination: never.

    Info:
        - ``position`` (2,) float32, m.
        - ``mode``: 1 relay, 0 jamming.
        - ``off_map``: the last flight would have left the map and was turned back.
        - ``secrecy_sum_rate``, bps/Hz, before the penalty; 0 after a reset.

    Reset options: ``position`` (2,) m, where to start instead of at ``helper_starts[0]``.

    ``reset(seed=s)`` starts the random numbers that ``make_env(seed=s)`` would draw; without a
    seed, they go on.

    Args:
        scenario: node positions and parameters, or the name of a preset.
        scheme: "hybrid", "relay" or "jamming".
        clock: append the slots flown to the observation.
        geofence: slow flights so that they end on the map.
        device: where to compute; observations are NumPy arrays on any device.
        render_mode: "rgb_array" for :meth:`render` to draw the map, or None.
        reward: what a slot earns, as for :func:`hyuav.make_env`.

    Raises:
        InputError: (a ``ValueError``) an argument, action or reset option that is not accepted.

    Example:
        >>> env = gymnasium.make("hyuav/SecureOffloading-v0", scenario="two_clusters")
        >>> observation, info = env.reset(seed=0)
        >>> observation.shape, info["position"]
        ((15,), array([-60., -60.], dtype=float32))
    """

    metadata: dict[str, Any] = RENDERING

    def __init__(
        self,
        scenario: Scenario | str = "two_clusters",
        scheme: str = "hybrid",
        *,
        clock: bool = False,
        geofence: bool = False,
        device: torch.device | str | None = None,
        render_mode: str | None = None,
        reward: Reward | Source | str = SUM_RATE,
    ) -> None:
        seed = int(self.np_random.integers(2**63))
        env = make_env(
            scenario,
            scheme,
            (),
            device,
            seed,
            clock=clock,
            geofence=geofence,
            reward=reward,
        )
        self._flights = Flights(env, render_mode)
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
        return self._flights.observation(), self._info(np.zeros((), np.float32))

    def step(self, action: ArrayLike) -> tuple[Floats, float, bool, bool, dict[str, Any]]:
        """Fly one slot."""
        reward, sum_rate, truncated = self._flights.step(action)
        observation, info = self._flights.observation(), self._info(sum_rate)
        return observation, reward.item(), False, truncated.item(), info

    def render(self) -> NDArray[np.uint8] | None:
        """The map and the flight up to now, (height, width, 3); None without a render mode."""
        return None if self.render_mode is None else self._flights.frame()

    def _info(self, secrecy_sum_rate: Floats) -> dict[str, Any]:
        entries = self._flights.info(secrecy_sum_rate)
        return {name: value if value.ndim else value.item() for name, value in entries.items()}


class SecureOffloadingVectorEnv(VectorEnv[Floats, Floats, NDArray[Any]]):
    """N helpers flown as one batch, what ``gymnasium.make_vec("hyuav/SecureOffloading-v0")`` makes.

    Every entry is that of :class:`SecureOffloadingGymEnv` with N in front. All rows draw from one
    stream of random numbers, so that N rows differ from N single environments with N seeds.

    Autoreset: a row that has flown T slots starts anew within the same step
    (``AutoresetMode.SAME_STEP``). The observation and ``info`` returned are then those of the
    reset; ``info["final_obs"]`` (N, U + 5) and ``info["final_info"]`` hold what the last slot
    brought, in the rows where ``info["_final_obs"]`` (N,) is true. Every other entry of ``info``
    has such a mask too.

    Reset options: ``position`` (2,) or (N, 2) m; and ``reset_mask`` (N,) bool, the rows to reset
    while the others fly on.

    Args:
        num_envs: N.
        scenario: as for :class:`SecureOffloadingGymEnv`, like the following.
        scheme: or one for each row.
        clock: append the slots flown to the observation.
        geofence: slow flights so that they end on the map.
        device: where to compute.
        render_mode: "rgb_array" for :meth:`render` to draw each row's map, or None.
        reward: what a slot earns, as for :func:`hyuav.make_env`.

    Raises:
        InputError: (a ``ValueError``) an argument, action or reset option that is not accepted.
    """

    metadata: dict[str, Any] = RENDERING | {"autoreset_mode": AutoresetMode.SAME_STEP}

    def __init__(
        self,
        num_envs: int = 1,
        scenario: Scenario | str = "two_clusters",
        scheme: str | Sequence[str] = "hybrid",
        *,
        clock: bool = False,
        geofence: bool = False,
        device: torch.device | str | None = None,
        render_mode: str | None = None,
        reward: Reward | Source | str = SUM_RATE,
    ) -> None:
        num_envs = checked(Count, "num_envs", num_envs)
        seed = int(self.np_random.integers(2**63))
        env = make_env(
            scenario,
            scheme,
            num_envs,
            device,
            seed,
            clock=clock,
            geofence=geofence,
            reward=reward,
        )
        self._flights = Flights(env, render_mode)
        self.num_envs = num_envs
        self.single_observation_space, self.single_action_space = self._flights.spaces()
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.render_mode = render_mode

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Floats, dict[str, Any]]:
        """Start episodes; see the class for the ``options``."""
        chosen = accepted_options(options, ("position", "reset_mask"))
        if (mask := chosen.get("reset_mask")) is not None:
            mask = self._checked_mask(mask)
        seed = None if seed is None else as_seed(seed)
        super().reset(seed=seed)
        self._flights.reset(seed, chosen.get("position"), mask)
        started = np.ones(self.num_envs, bool) if mask is None else mask
        info = self._flights.info(np.zeros(self.num_envs, np.float32))
        return self._flights.observation(), _with_masks(info, started)

    def step(
        self, actions: ArrayLike
    ) -> tuple[Floats, NDArray[Any], NDArray[Any], NDArray[Any], dict[str, Any]]:
        """Fly one slot in every row, and reset the rows that have then flown T."""
        reward, sum_rate, truncated = self._flights.step(actions)
        observation, info = self._flights.observation(), self._flights.info(sum_rate)
        every_row = np.ones(self.num_envs, bool)
        terminated = np.zeros(self.num_envs, bool)
        if not truncated.any():
            return observation, reward, terminated, truncated, _with_masks(info, every_row)
        final = {"final_obs": observation, "final_info": _with_masks(info, truncated)}
        self._flights.reset(None, None, truncated)
        info = self._flights.info(np.where(truncated, np.float32(0.0), sum_rate))
        infos = _with_masks(info, every_row) | _with_masks(final, truncated)
        return self._flights.observation(), reward, terminated, truncated, infos

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """Each row's map and flight up to now; None without a render mode."""
        if self.render_mode is None:
            return None
        return tuple(self._flights.frame((row,)) for row in range(self.num_envs))

    def _checked_mask(self, mask: ArrayLike) -> Flags:
        rows = np.asarray(mask)
        if rows.shape != (self.num_envs,) or rows.dtype != np.bool_ or not rows.any():
            accepted = f"shape {(self.num_envs,)} of true and false, at least one of them true"
            raise InputError(rejection("reset_mask", mask, accepted))
        return rows


def _with_masks(entries: Mapping[str, Any], rows: Flags) -> dict[str, Any]:
    """Add to each entry the rows that it holds for, as Gymnasium's vector infos have it."""
    return dict(entries) | {f"_{name}": rows.copy() for name in entries}
