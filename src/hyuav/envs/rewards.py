"""The objectives that come with the package, by name, and how a user's own join them."""

import copyreg
from typing import Any

import torch
from tensordict import TensorDictBase
from torch import Tensor
from torchrl.data import Composite, Unbounded
from torchrl.envs import Transform

from hyuav._support.errors import InputTypeError, rejection
from hyuav._support.registry import Registry
from hyuav.envs.reward import EPISODE, FUNCTION, POSITION, VELOCITY, Reward, Source
from hyuav.physics.outcome import SlotOutcome
from hyuav.physics.scenario import Scenario

FAIR_RATE = 0.01
"""bps/Hz, beside which a UE's mean rate counts in the logarithm of proportional fairness."""

BESIDE = "accumulated_rate"


def sum_rate(slot: SlotOutcome) -> Tensor:
    """The secrecy sum-rate (eq. 6): (..., 1) bps/Hz."""
    return slot.sum_rate


def secrecy_energy_efficiency(slot: SlotOutcome) -> Tensor:
    """The secret bits of a slot for each joule of flying and sending: (..., 1) bit/Hz/J.

    That is C Delta / (E_fly + E_helper + sum_u E_u), with the secrecy sum-rate C, the helper's
    flight and transmission, and the transmissions of the UEs that offload. A slot that takes no
    energy, in which the helper hovers in relay mode and no UE offloads, earns 0.
    """
    of_helpers = slot.flight_energy + slot.helper_transmission_energy
    of_ues = slot.ue_transmission_energy
    spent = of_helpers.sum(dim=-1, keepdim=True) + of_ues.sum(dim=-1, keepdim=True)
    bits = slot.sum_rate * slot.scenario.slot_duration
    return torch.where(spent > 0.0, bits / spent, 0.0)


class ProportionalFairness(Transform):
    """The growth of sum_u log(1 + r_u / c) in each slot, so that an episode earns that sum.

    r_u is the mean over the T slots of the secrecy rate at which UE u offloads, 0 in the slots in
    which it does not; c is :data:`FAIR_RATE`. What the UEs have reached so far stands in the entry
    ``accumulated_rate`` (..., U), in bps/Hz, which begins with 0 in every episode.

    Args:
        scenario: its numbers of UEs and of slots.
    """

    def __init__(self, scenario: Scenario) -> None:
        super().__init__(in_keys=["offloading_rate"], out_keys=["reward"])
        self._num_ues, self._full_rate = scenario.num_ues, scenario.num_slots * FAIR_RATE

    def _step(self, tensordict: TensorDictBase, next_tensordict: TensorDictBase) -> TensorDictBase:
        """Earn by how much the objective has grown."""
        before = tensordict[BESIDE]
        after = before + next_tensordict["offloading_rate"]
        reached = torch.log1p(torch.stack([before, after]) / self._full_rate)
        grown = reached.sum(dim=-1, keepdim=True).diff(dim=0).squeeze(0)
        next_tensordict[BESIDE], next_tensordict["reward"] = after, grown
        return next_tensordict

    def _reset(
        self, tensordict: TensorDictBase, tensordict_reset: TensorDictBase
    ) -> TensorDictBase:
        """Begin with nothing, in the rows that are reset."""
        start = torch.zeros_like(tensordict_reset["offloading_rate"])
        if (rows := tensordict.get("_reset", None)) is not None:
            start = torch.where(rows, start, tensordict.get(BESIDE, start))
        tensordict_reset[BESIDE] = start
        return tensordict_reset

    def transform_observation_spec(self, observation_spec: Composite) -> Composite:
        """Add what the UEs have reached."""
        observation_spec[BESIDE] = self._spec(observation_spec)
        return observation_spec

    def transform_input_spec(self, input_spec: Composite) -> Composite:
        """A slot starts from it as well."""
        state_spec = input_spec["full_state_spec"]
        state_spec[BESIDE] = self._spec(state_spec)
        return input_spec

    def _spec(self, beside: Composite) -> Unbounded:
        like = beside["position"]
        shape = (*beside.shape, self._num_ues)
        return Unbounded(shape, dtype=like.dtype, device=like.device)


def _accept(name: str, value: Any, reference: str | None) -> Reward:
    """A reward of a file or a package under the name that chooses it."""
    if not isinstance(value, Reward | Transform) and not callable(value):
        raise InputTypeError(rejection("reward", name, f"{FUNCTION}, or a transform"))
    if reference is not None:
        name = reference.replace("\\", "/").rpartition("/")[2]
    if isinstance(value, Reward):
        return Reward(value.source, name, value.unit, value.depends_on, reference)
    return Reward(value, name, reference=reference)


SUM_RATE = "sum_rate"

REWARDS: Registry[Reward] = Registry(
    {
        SUM_RATE: Reward(sum_rate, SUM_RATE, "bps/Hz", POSITION),
        "secrecy_energy_efficiency": Reward(
            secrecy_energy_efficiency, "secrecy_energy_efficiency", "bit/Hz/J", VELOCITY
        ),
        "proportional_fairness": Reward(
            ProportionalFairness, "proportional_fairness", depends_on=EPISODE
        ),
    },
    field="reward",
    kind="a reward",
    group="hyuav.rewards",
    accept=_accept,
)
"""Those of this library, and after them those that were named."""

DEFAULT = REWARDS[SUM_RATE]


def as_reward(reward: "Reward | Source | str") -> Reward:
    """A reward as it is, or of a name, a function or a transform.

    Raises:
        InputError: an unknown name.
        InputTypeError: something else.
    """
    if isinstance(reward, str):
        return REWARDS.find(reward)
    return reward if isinstance(reward, Reward) else Reward(reward)


def sum_rate_of(after: TensorDictBase, off_map_penalty: float) -> Tensor:
    """The secrecy sum-rate of slots, whatever is earned there: (..., 1) bps/Hz.

    Args:
        after: what :func:`hyuav.make_env` gives after the slots.
        off_map_penalty: of the scenario.
    """
    told: Tensor | None = after.get(SUM_RATE, None)
    if told is not None:
        return told
    reward: Tensor = after["reward"]
    off_map = after["off_map"].sum(dim=-1, keepdim=True, dtype=reward.dtype)
    return reward + off_map_penalty * off_map


def _sent(reward: Reward) -> tuple[Any, ...]:
    """What another process makes the reward of; it may have to run a file first."""
    if reward.reference is not None:
        return _received, (reward.reference,)
    if REWARDS.get(reward.name) is reward:
        return as_reward, (reward.name,)
    return Reward, (reward.source, reward.name, reward.unit, reward.depends_on)


def _received(reference: str) -> Reward:
    return REWARDS[REWARDS.run_own(reference)]


copyreg.pickle(Reward, _sent)
