"""Each helper as an agent of PettingZoo's parallel API; needs the extra ``multiagent``."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import torch
from gymnasium.error import ResetNeeded
from gymnasium.spaces import Box, Space
from numpy.typing import ArrayLike, NDArray

from hyuav._support.errors import InputError, InputTypeError, rejection
from hyuav._support.machine import require_installed
from hyuav.envs.agents import agent_names
from hyuav.envs.arguments import as_seed
from hyuav.envs.flights import (
    RENDERING,
    WHERE_ASKED_FOR,
    Flights,
    Floats,
    as_array,
    limited,
    require_options,
)
from hyuav.envs.observation import ObservationLayout
from hyuav.envs.transforms import make_env
from hyuav.physics.generators import LayoutGenerator
from hyuav.physics.scenario import ScenarioLike

require_installed(["pettingzoo"], "multiagent")
from pettingzoo import ParallelEnv  # noqa: E402


class SecureOffloadingParallelEnv(ParallelEnv[str, Floats, Floats]):
    """Helpers that fly as agents, ``helper_0`` and so on in the order of ``helper_starts``.

    It is :func:`hyuav.make_env` for one flight of all H helpers; U is the number of UEs, E of
    eavesdroppers.

    Observation of each agent: (U + 4 + E + 3 (H - 1),) float32 in the order of
    :meth:`hyuav.envs.observation.ObservationLayout.of_each`; with a clock one number more.

    Action of each agent: (2,) float32 in [-1, 1], the velocity in units of v_max; clipped. With
    power control (3,).

    Reward: the same for all agents, the secrecy sum-rate of the slot (eq. 6) less the off-map
    penalty for each helper, bps/Hz; or what ``reward`` says, less the penalties.

    Truncation: of all agents after T slots. Termination: never.

    Info of each agent:
        - ``position`` (2,) float32, m, ``mode`` (1 relay, 0 jamming) and ``off_map``: its own.
        - ``secrecy_sum_rate``, bps/Hz, before the penalty; 0 after a reset.
        - ``diagnostics`` and ``fading``, only where asked for: of the slot, as in
          :class:`hyuav.envs.gymnasium.SecureOffloadingGymEnv`.

    State: the observation of one learner for all helpers, as
    :class:`hyuav.envs.observation.ObservationLayout` has it.

    Reset options: ``position`` (H, 2) m, where to start instead of at ``helper_starts``. Others are
    left alone, as PettingZoo asks for.

    Args:
        scenario: node positions and parameters, or the name of a preset; or what draws a layout
            anew in each episode, such as a :class:`hyuav.LayoutFamily`.
        scheme: "hybrid", "relay", "jamming", or a letter r or j for each helper.
        max_episode_steps: T, instead of the scenario's ``num_slots``.
        device: where to compute; observations are NumPy arrays on any device.
        render_mode: "rgb_array" for :meth:`render` to draw the map, or None.
        options: all else that :func:`hyuav.make_env` takes, such as ``clock``, ``geofence`` and
            ``diagnostics``.

    Raises:
        InputError: (a ``ValueError``) an argument, action or position that is not accepted.
        ResetNeeded: a step before the first reset or after the end of an episode.

    Example:
        >>> env = SecureOffloadingParallelEnv("two_clusters")
        >>> observations, infos = env.reset(seed=0)
        >>> observations["helper_0"].shape
        (15,)
    """

    metadata: dict[str, Any] = RENDERING | {"name": "hyuav_secure_offloading"}

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
        require_options(options)
        env = make_env(limited(scenario, max_episode_steps), scheme, (), device, **options)
        self._flights = Flights(env, render_mode)
        self._layout: ObservationLayout = env.transform[-1].layout
        self.possible_agents = agent_names(self._layout.num_helpers)
        self.agents: list[str] = []
        self.state_space, _ = self._flights.spaces()
        low, high = (
            self._of_each(bound) for bound in (self.state_space.low, self.state_space.high)
        )
        self.observation_spaces = {name: Box(low[name], high[name]) for name in low}
        shape = (self._layout.size_of_each_action,)
        self.action_spaces = {name: Box(-1.0, 1.0, shape) for name in low}
        self.render_mode = render_mode

    def observation_space(self, agent: str) -> Space[Floats]:
        """The agent's, which is like that of all others."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> Space[Floats]:
        """The agent's, which is like that of all others."""
        return self.action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Floats], dict[str, dict[str, Any]]]:
        """Start an episode; see the class for the ``options``."""
        position = None if options is None else options.get("position")
        self._flights.reset(None if seed is None else as_seed(seed), position, None)
        self.agents = list(self.possible_agents)
        return self._of_each(self.state()), self._infos(np.zeros((), np.float32))

    def step(
        self, actions: Mapping[str, ArrayLike]
    ) -> tuple[
        dict[str, Floats],
        dict[str, float],
        dict[str, bool],
        dict[str, bool],
        dict[str, dict[str, Any]],
    ]:
        """Fly one slot by an action of each agent."""
        if not self.agents:
            raise ResetNeeded("call reset() before the first step() and after an episode's end")
        reward, sum_rate, truncated = self._flights.step(self._joined(actions))
        ended = bool(truncated)
        outcome = (
            self._of_each(self.state()),
            dict.fromkeys(self.agents, float(reward)),
            dict.fromkeys(self.agents, False),
            dict.fromkeys(self.agents, ended),
            self._infos(sum_rate),
        )
        self.agents = [] if ended else self.agents
        return outcome

    def state(self) -> Floats:
        """What one learner for all helpers observes: (observed,)."""
        return self._flights.observation()

    def render(self) -> NDArray[np.uint8] | None:
        """The map and the flights up to now, (height, width, 3); None without a render mode."""
        return None if self.render_mode is None else self._flights.frame()

    def _joined(self, actions: Mapping[str, ArrayLike]) -> Floats:
        """The actions of all agents in one row."""
        accepted = f"an action for each of {', '.join(self.possible_agents)}"
        if not isinstance(actions, Mapping):
            raise InputTypeError(rejection("actions", actions, accepted))
        if set(actions) != set(self.possible_agents):
            raise InputError(rejection("actions", sorted(actions), accepted))
        rows = [
            as_array(f"actions[{name}]", actions[name], [space.shape])
            for name, space in self.action_spaces.items()
        ]
        return np.concatenate(rows)

    def _of_each(self, values: Floats) -> dict[str, Floats]:
        """An observation of all helpers, or its bounds, as that of each agent."""
        rows = self._layout.of_each(torch.from_numpy(values)).numpy()
        return dict(zip(self.possible_agents, rows, strict=True))

    def _infos(self, secrecy_sum_rate: Floats) -> dict[str, dict[str, Any]]:
        """What is told of each agent besides."""
        told = self._flights.info(secrecy_sum_rate)
        positions = told["position"].reshape(-1, 2)
        modes, off_map = (told[name].flatten().tolist() for name in ("mode", "off_map"))
        of_the_slot = {name: told[name] for name in WHERE_ASKED_FOR if name in told}
        return {
            name: {
                "position": positions[index],
                "mode": modes[index],
                "off_map": off_map[index],
                "secrecy_sum_rate": float(secrecy_sum_rate),
                **of_the_slot,
            }
            for index, name in enumerate(self.possible_agents)
        }


parallel_env = SecureOffloadingParallelEnv
"""The name by which PettingZoo's modules offer such a class."""
