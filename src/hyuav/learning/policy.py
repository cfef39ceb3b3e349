"""Actors that fly without noise: while they are trained, and as policies afterwards."""

import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np
import torch
from numpy.typing import NDArray
from tensordict import TensorDict, TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import Tensor, nn
from torchrl.envs import TransformedEnv

from hyuav._support.errors import InputError, InputTypeError, rejection
from hyuav._support.parameters import Count, checked
from hyuav.envs.observation import ObservationLayout
from hyuav.envs.reward import Reward, Source
from hyuav.envs.rewards import DEFAULT, SUM_RATE, as_reward
from hyuav.envs.transforms import make_env
from hyuav.learning.algorithm import Algorithm, AlgorithmParameters, made_on
from hyuav.learning.export import Signature, export
from hyuav.learning.weights import load_weights, select_learners
from hyuav.physics.modes import fixed_modes
from hyuav.physics.scenario import Scenario, as_scenario

Observed = TypeVar("Observed", Tensor, NDArray[Any], TensorDictBase)


class NoiseFreeReturn(NamedTuple):
    """What actors earn without noise, on average over the same episodes."""

    reward: Tensor
    """(N,) in the unit of the reward, accumulated, with penalties; less what a guide knows to be
    chance, so that flights are told apart that differ by less."""
    sum_rate: Tensor
    """(N,) bps/Hz, the accumulated secrecy sum-rate alone."""


@torch.no_grad()
def fly_noise_free(
    env: TransformedEnv, algorithm: Algorithm, reward_scale: float
) -> tuple[NoiseFreeReturn, Tensor]:
    """Fly actors without noise for an episode of each of an environment's rows.

    Args:
        env: (N, episodes).
        algorithm: of N learners.
        reward_scale: of the rewards that the learners store, against bps/Hz.

    Returns:
        what they earn, and where they flew and at which power in the first of the episodes,
        (T, N, actions), as :meth:`ObservationLayout.place` has it.
    """
    scenario, learners = env.base_env.scenario, env.batch_size[0]
    layout = ObservationLayout(scenario, clock=False)  # places stand first, clock or not
    off_map, control_term, told = torch.zeros(3, learners, dtype=torch.float32, device=env.device)
    is_told = env.base_env.reward != DEFAULT
    state, places = env.reset(), []
    for _ in range(scenario.num_slots):
        slot = env.step(algorithm.actor(state))
        control_term += algorithm.guide.control_term(slot).mean(dim=(1, 2))
        state = env.step_mdp(slot)
        off_map += state["off_map"].sum(dim=-1).float().mean(dim=-1)
        if is_told:
            told += state[SUM_RATE].squeeze(-1).mean(dim=-1)
        places.append(layout.place(slot)[:, 0])
    reward: Tensor = state["episode_reward"].squeeze(-1).mean(dim=-1)
    sum_rate = told if is_told else reward + scenario.off_map_penalty * off_map
    earned = NoiseFreeReturn(reward - control_term / reward_scale, sum_rate)
    return earned, torch.stack(places)


class Policy(TensorDictModuleBase):
    """A way to fly by what is observed, which knows the environment that it was trained in.

    It is a module of PyTorch that takes observations as a tensor or a NumPy array (..., observed),
    and gives actions (..., actions) of the same kind, in [-1, 1], as
    :class:`hyuav.envs.observation.ObservationLayout` has them; of a TensorDict it reads
    ``observation`` and writes ``action``. An observation that does not fit is refused in one line.

    Args:
        network: maps observations (K, observed) to actions (K, actions), as a module of plain
            tensors, or one of TensorDicts that reads ``observation`` and writes ``action``; of
            several learners (N, K, observed) to (N, K, actions).
        scenario: that it was trained on, or the name of a preset.
        scheme: who chose the mode there: "hybrid", "relay" or "jamming".
        clock: whether ``observation`` carried the slots flown; see :func:`hyuav.make_env`.
        geofence: whether flights were slowed to end on the map.
        reward: what a slot earned; see :class:`hyuav.Reward`.
        learners: N. With one, it flies a batch of any shape; of several, each flies one row of the
            batch's first dimension.

    Raises:
        InputError: an unknown preset or scheme.
        InputTypeError: an argument of the wrong type, or a module that reads other entries.

    Example:
        >>> policy = hyuav.load("runs/NAME").policy
        >>> flights = policy.make_env(batch_size=64, seed=0).rollout(20, policy)
    """

    in_keys = ("observation",)
    out_keys = ("action",)

    def __init__(
        self,
        network: nn.Module,
        scenario: Scenario | str,
        scheme: str = "hybrid",
        *,
        clock: bool = False,
        geofence: bool = False,
        reward: Reward | Source | str = SUM_RATE,
        learners: int = 1,
    ) -> None:
        super().__init__()
        scenario, objective = as_scenario(scenario), as_reward(reward)
        fixed_modes(scheme, scenario.num_helpers)
        self.environment: dict[str, Any] = {
            "scenario": scenario,
            "scheme": scheme,
            "clock": checked(bool, "clock", clock),
            "geofence": checked(bool, "geofence", geofence),
            **({} if objective == DEFAULT else {"reward": objective}),
        }
        """The arguments of :func:`hyuav.make_env`, and of ``gymnasium.make``, by which an
        environment is what it was in training."""
        self.learners: int = checked(Count, "learners", learners)
        self._layout = ObservationLayout(self.environment["scenario"], clock=clock)
        self.network = _as_network(network)

    def forward(self, observation: Observed) -> Observed:
        """Act on observations (..., observed): actions (..., actions) of the same kind and device.

        Args:
            observation: a tensor or an array of finite floating-point numbers, of any precision;
                or a TensorDict, into which ``action`` is written.

        Raises:
            InputError: of another size, or not finite.
            InputTypeError: of another type.
        """
        if isinstance(observation, TensorDictBase):
            self._require_environment(observation)
            return observation.set("action", self.forward(observation.get("observation", None)))
        if isinstance(observation, np.ndarray):
            if observation.dtype.kind != "f":
                raise InputTypeError(rejection("observation", observation.dtype, self._accepted))
            widest = np.array(observation, dtype=np.float64)  # in this machine's byte order
            return self.forward(torch.from_numpy(widest)).numpy(force=True)
        return self._act(observation)

    @torch.no_grad()
    def act(self, observation: Observed) -> Observed:
        """The same without gradients: actions (..., actions) for observations (..., observed)."""
        return self.forward(observation)

    def predict(
        self,
        observation: NDArray[Any],
        state: tuple[NDArray[Any], ...] | None = None,
        episode_start: NDArray[Any] | None = None,  # noqa: ARG002
        deterministic: bool = True,  # noqa: ARG002
    ) -> tuple[NDArray[Any], tuple[NDArray[Any], ...] | None]:
        """Act as the models of Stable-Baselines3 do, so that its functions take this policy.

        Args:
            observation: (..., observed), as for :meth:`forward`.
            state: given back as it is; the policy remembers nothing.
            episode_start: not used, for the same reason.
            deterministic: not used: it flies without noise in any case.

        Returns:
            the actions (..., actions), and ``state``.
        """
        return self.act(observation), state

    def make_env(self, **options: Any) -> TransformedEnv:
        """An environment as in training: its scenario, scheme, clock and geofence.

        Args:
            options: further arguments of :func:`hyuav.make_env`, such as ``batch_size`` and
                ``seed``; what is given here takes the place of what was in training.

        Raises:
            InputError: as :func:`hyuav.make_env`.
        """
        return make_env(**{**self.environment, **options})

    def export(self, path: str | Path) -> None:
        """Write the network to a file, in the format that the suffix tells.

        ``.onnx`` for ONNX Runtime and others, ``.pt2`` for ``torch.export.load``, ``.pt`` for
        ``torch.jit.load``. Its input is ``observation`` (batch, observed) float32, its output
        ``action`` (batch, actions); of several learners (N, batch, ...). Beside it stands
        :attr:`environment` in JSON, under the name ``environment``.

        Args:
            path: of the file; one that is there is replaced.

        Raises:
            InputError: another suffix, a place that cannot be written to, or what writes ONNX is
                not installed.
        """
        shape = (*self._rows, 2, self._layout.size)
        example = torch.zeros(shape, dtype=torch.float32, device="cpu")
        free = {"observation": {len(shape) - 2: "batch"}}
        signature = Signature({"observation": example}, free, "action")
        export(self.network, path, signature, self.environment)

    @property
    def _rows(self) -> tuple[int, ...]:
        return (self.learners,) if self.learners > 1 else ()

    @property
    def _accepted(self) -> str:
        scenario, clock = self.environment["scenario"], self.environment["clock"]
        shape = ", ".join([*map(str, self._rows), "...", str(self._layout.size)])
        return (
            f"finite floating-point numbers of shape ({shape}), as an environment gives with "
            f"{scenario.num_ues} UEs, {scenario.num_eavesdroppers} eavesdropper(s), "
            f"{scenario.num_helpers} helper(s) and clock={clock} (policy.make_env() makes one)"
        )

    def _require_environment(self, state: TensorDictBase) -> None:
        """Tell what can be seen of an environment that is not as in training."""
        distances, off_map = state.get("distances", None), state.get("off_map", None)
        if distances is not None and distances.shape[-1] != self._layout.num_distances:
            shape = tuple(state["observation"].shape)
            raise InputError(rejection("observation", shape, self._accepted))
        fenced = self.environment["geofence"] and not torch.compiler.is_compiling()
        if fenced and off_map is not None and off_map.any():
            warnings.warn(
                "the environment turned the helper back at the map's edge, but the policy was "
                "trained with geofence=True: policy.make_env() makes such an environment",
                stacklevel=2,
            )

    def _act(self, observation: Tensor) -> Tensor:
        """Flatten what lies between the learners and the features, and apply the network."""
        if not isinstance(observation, Tensor) or observation.layout != torch.strided:
            raise InputTypeError(rejection("observation", observation, self._accepted))
        if not observation.is_floating_point():
            raise InputTypeError(rejection("observation", observation.dtype, self._accepted))
        shape, rows, size = observation.shape, self._rows, self._layout.size
        if shape[-1:] != (size,) or shape[: len(rows)] != rows or len(shape) <= len(rows):
            raise InputError(rejection("observation", tuple(shape), self._accepted))
        like = next(self.network.parameters(), observation)
        observed = observation.to(like)
        if not torch.compiler.is_compiling() and not observed.isfinite().all():
            raise InputError(rejection("observation", observation.tolist(), self._accepted))
        action: Tensor = self.network(observed.reshape(*rows, -1, size))
        return action.reshape(*shape[:-1], self._layout.action_size).to(observation.device)


class ActorNetwork(nn.Module):
    """An actor that reads and writes TensorDicts, as a network of plain tensors.

    Args:
        actor: reads ``observation``, writes ``action``.
        learner_axis: whether the actor has an axis of one learner in front, which the observations
            have not.
    """

    def __init__(self, actor: TensorDictModuleBase, *, learner_axis: bool = False) -> None:
        super().__init__()
        self.actor, self.learner_axis = actor, learner_axis

    def forward(self, observation: Tensor) -> Tensor:
        """Map observations (..., observed) to actions (..., actions)."""
        observed = observation.unsqueeze(0) if self.learner_axis else observation
        entries = TensorDict({"observation": observed}, batch_size=observed.shape[:-1])
        action: Tensor = self.actor(entries)["action"]
        return action.squeeze(0) if self.learner_axis else action


def _as_network(network: nn.Module) -> nn.Module:
    if isinstance(network, TensorDictModuleBase):
        if list(network.in_keys) != ["observation"] or "action" not in network.out_keys:
            accepted = "a module that reads observation alone and writes action"
            raise InputTypeError(rejection("network", type(network).__name__, accepted))
        return ActorNetwork(network)
    if not isinstance(network, nn.Module):
        raise InputTypeError(rejection("network", network, "a torch.nn.Module"))
    return network


def learned_policy(
    scenario: Scenario,
    algorithm: AlgorithmParameters,
    weights: dict[str, Tensor],
    learners: Sequence[int] = (0,),
    scheme: str = "hybrid",
    reward: Reward = DEFAULT,
) -> Policy:
    """The noise-free actors of learners, of which no gradient is kept.

    Args:
        scenario: that they were trained on.
        algorithm: with which they were trained.
        weights: of all learners, as a training saves them.
        learners: which of them.
        scheme: of theirs.
        reward: that they learned to earn.

    Raises:
        InputError: the weights do not fit the algorithm or the number of UEs.
    """
    own = select_learners(weights, learners)
    like = next(iter(own.values()))  # rather than the default device and type of tensors
    with made_on(like.device):
        built = algorithm.build(len(learners), scenario)
    load_weights(built.loss, own)
    actor = built.actor.to(like.dtype)
    return Policy(
        ActorNetwork(actor, learner_axis=len(learners) == 1).requires_grad_(False).eval(),
        scenario,
        scheme,
        clock=algorithm.clock,
        geofence=algorithm.geofence,
        reward=reward,
        learners=len(learners),
    )
