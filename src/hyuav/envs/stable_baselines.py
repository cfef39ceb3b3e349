"""The native batch as what Stable-Baselines3 trains in; needs the extra ``sb3``."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers.vector import DictInfoToList
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import VecEnvStepReturn

from hyuav._support.errors import InputError, rejection
from hyuav.envs.flights import Floats, accepted_options
from hyuav.envs.gymnasium import SecureOffloadingVectorEnv
from hyuav.physics.scenario import Scenario


class NativeVecEnv(VecEnv):
    """N helpers flown as one batch: a ``VecEnv`` of Stable-Baselines3.

    Observations, actions, rewards and the entries of ``infos`` are those of
    :class:`hyuav.envs.gymnasium.SecureOffloadingVectorEnv`. A row that has flown its T slots starts
    anew in the same step; its info then tells that last slot, with ``terminal_observation`` and
    ``TimeLimit.truncated``, and ``reset_infos`` the start.

    ``seed(s)`` gives row i the seed s + i in the next reset, as Stable-Baselines3 has it.

    Args:
        num_envs: N.
        scenario: node positions and parameters, or the name of a preset; or one for each row.
        scheme: "hybrid", "relay" or "jamming"; or one for each row.
        options: all else that :class:`hyuav.envs.gymnasium.SecureOffloadingVectorEnv` takes, but
            ``autoreset_mode``.

    Raises:
        InputError: (a ``ValueError``) an argument, action or reset option that is not accepted.

    Example:
        >>> model = stable_baselines3.PPO("MlpPolicy", NativeVecEnv(64, "two_clusters"))
    """

    actions: Floats

    def __init__(
        self,
        num_envs: int = 1,
        scenario: Scenario | str | Sequence[Scenario | str] = "two_clusters",
        scheme: str | Sequence[str] = "hybrid",
        **options: Any,
    ) -> None:
        mode = AutoresetMode.SAME_STEP
        env = SecureOffloadingVectorEnv(num_envs, scenario, scheme, autoreset_mode=mode, **options)
        self._env = env
        self._listed: Any = DictInfoToList(env)
        super().__init__(env.num_envs, env.single_observation_space, env.single_action_space)
        self.metadata["render_fps"] = env.metadata["render_fps"]

    def reset(self) -> Floats:
        """Start every row's episode: (N, observed)."""
        observation, self.reset_infos = self._listed.reset(
            seed=self._seeds, options=self._reset_options_of_rows()
        )
        self._reset_seeds()
        self._reset_options()
        return observation

    def step_async(self, actions: Floats) -> None:
        """Take the actions (N, 2), for :meth:`step_wait` to fly by."""
        self.actions = actions

    def step_wait(self) -> VecEnvStepReturn:
        """Fly one slot in every row."""
        observation, reward, _, truncated, infos = self._listed.step(self.actions)
        for row, ends in enumerate(truncated.tolist()):
            if ends:
                self.reset_infos[row] = infos[row]
                final = infos[row].pop("final_obs")
                infos[row] = infos[row].pop("final_info") | {"terminal_observation": final}
            infos[row]["TimeLimit.truncated"] = ends
        return observation, reward, truncated, infos

    def close(self) -> None:
        """Do nothing: there is nothing to release."""

    def get_images(self) -> Sequence[NDArray[np.uint8] | None]:
        """A picture of each row's flight; None without a render mode."""
        return self._env.render() or [None] * self.num_envs

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """An attribute of the batch, for each row asked for."""
        return [getattr(self._env, attr_name) for _ in self._rows(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Set an attribute of the batch.

        Raises:
            InputError: not for all rows.
        """
        if len(self._rows(indices)) != self.num_envs:
            accepted = "all rows, which are one environment"
            raise InputError(rejection("indices", indices, accepted))
        setattr(self._env, attr_name, value)

    def env_method(
        self, method_name: str, *method_args: Any, indices: Any = None, **method_kwargs: Any
    ) -> list[Any]:
        """Call a method of the batch once; each row asked for gets what it returns."""
        result = getattr(self._env, method_name)(*method_args, **method_kwargs)
        return [result for _ in self._rows(indices)]

    def env_is_wrapped(
        self,
        wrapper_class: type[Any],  # noqa: ARG002 - of the interface
        indices: Any = None,
    ) -> list[bool]:
        """No row is: false for each."""
        return [False for _ in self._rows(indices)]

    def _rows(self, indices: Any) -> list[int]:
        return list(self._get_indices(indices))

    def _reset_options_of_rows(self) -> dict[str, Any] | None:
        """The options that ``set_options`` was given, of all rows together."""
        given = [accepted_options(row, ("position",)).get("position") for row in self._options]
        return None if all(position is None for position in given) else {"position": given}
