"""Fly any set of schemes through the same fading and account for each in one table."""

import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pandas as pd
import torch
from pydantic import Field
from pydantic.dataclasses import dataclass as pydantic_dataclass
from scipy.special import stdtrit
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import Tensor

from hyuav._support.errors import InputError, InputTypeError, rejection, require_choice
from hyuav._support.files import write_durably
from hyuav._support.parameters import (
    Count,
    CountOrZero,
    Parameters,
    PositiveNumber,
    mapping,
    parameter,
    require_record,
)
from hyuav._support.randomness import derived_seed
from hyuav.envs.reward import Reward, Source
from hyuav.envs.rewards import DEFAULT, SUM_RATE, as_reward
from hyuav.envs.transforms import make_env
from hyuav.experiments.schemes import SCHEMES, Kind
from hyuav.learning.policy import Policy
from hyuav.physics.scenario import Scenario, as_scenario
from hyuav.references.flight import FlightPolicy

Array = np.ndarray[Any, np.dtype[np.float64]]

EVALUATION_FILE, FLIGHTS_FILE = "evaluation.json", "flights.parquet"

PER_UE, WAY = ("offloading", "secrecy_rate", "ue_energy"), "way"
"""Columns of the flights with a list for the UEs; the last one only with several helpers: 0 where a
UE that offloads sends straight to L, i where it sends through helper i."""

RETURNS = ("secrecy_sum_rate", "reward")
"""What is told of each scheme with an interval; the latter only where it is not the former."""


@pydantic_dataclass(frozen=True)
class EvaluationParameters(Parameters):
    """How to evaluate."""

    episodes: Annotated[int, Field(ge=2, le=10**6)] = parameter(1000)
    flights: Count = parameter(3)
    seed: CountOrZero = parameter(10_000)
    resolution: PositiveNumber | None = parameter(None, unit="m")
    """Of the grid on which the optimum is found; None for 1 m, or 2 m where the reward depends on
    the velocity."""


@dataclass(frozen=True)
class Evaluation:
    """What a set of schemes brought in the same episodes."""

    summary: dict[str, Any]
    """The content of ``evaluation.json``."""
    flights: pd.DataFrame
    """A few episodes of each scheme, a row per slot."""

    def save(self, directory: Path) -> None:
        """Write ``evaluation.json`` and ``flights.parquet`` into ``directory``.

        Raises:
            OSError: one of them cannot be written; then an earlier one is still there.
        """
        text = json.dumps(self.summary, indent=2)
        write_durably(directory / FLIGHTS_FILE, self.flights.to_parquet())
        write_durably(directory / EVALUATION_FILE, f"{text}\n".encode())


def evaluate(
    scenario: Scenario | str,
    name: str,
    policies: Mapping[str, TensorDictModuleBase | Sequence[TensorDictModuleBase]],
    parameters: EvaluationParameters,
    device: torch.device | str | None = None,
    *,
    track: Callable[[Sequence[str]], Iterable[str]] = iter,
    reward: Reward | Source | str = SUM_RATE,
) -> Evaluation:
    """Fly every scheme through the same draws of fading and tasks.

    Args:
        scenario: node positions and parameters, or the name of a preset.
        name: of the scenario, for the record.
        policies: by scheme, names of :data:`.schemes.SCHEMES`: one or more, as from several seeds,
            that write ``action``. Fractions of the optimum are given where the optima are among
            them, and of what no flight exceeds where an optimum's flight tells it
            (:attr:`FlightPolicy.upper_bound`).
        parameters: how many episodes, how many of them kept slot by slot, and the seed.
        device: to fly on.
        track: passes on the schemes one by one, as what shows the progress does.
        reward: by which fractions of the optimum are told, and what is earned beside the secrecy
            sum-rate; as for :func:`hyuav.make_env`.

    Raises:
        InputError: no scheme, an unknown one, one without a policy, or a policy of another number
            of UEs; no such reward.
        InputTypeError: an argument of the wrong type.
    """
    scenario = as_scenario(scenario)
    by_scheme = {
        scheme: _several(scheme, given) for scheme, given in mapping("policies", policies).items()
    }
    if not by_scheme:
        raise InputError(rejection("policies", policies, "at least one scheme"))
    require_record("parameters", parameters, EvaluationParameters)
    reward = as_reward(reward)
    flown = {
        scheme: _together(
            [
                fly(scenario, scheme, policy, parameters, device, reward)
                for policy in by_scheme[scheme]
            ]
        )
        for scheme in track([scheme for scheme in SCHEMES if scheme in by_scheme])
    }
    bounds = {
        scheme: own.upper_bound
        for scheme, policies in by_scheme.items()
        for own in policies
        if isinstance(own, FlightPolicy) and own.upper_bound is not None
    }
    told = {} if reward == DEFAULT else {"reward": {"name": reward.name, "unit": reward.unit}}
    summary = {
        "scenario": name,
        "parameters": scenario.to_dict(),
        "num_slots": scenario.num_slots,
        "episodes": parameters.episodes,
        "seed": parameters.seed,
        "schemes": {
            scheme: _returns(flown, scheme, bounds) | _account(flights.totals, scenario)
            for scheme, flights in flown.items()
        },
        **told,
    }
    rows = [slot_table(scheme, flights.slots) for scheme, flights in flown.items()]
    return Evaluation(summary, pd.concat(rows, ignore_index=True))


def _several(scheme: str, given: object) -> Sequence[TensorDictModuleBase]:
    """One policy as several."""
    require_choice("scheme", scheme, SCHEMES)
    several = [given] if isinstance(given, TensorDictModuleBase) else given
    line = rejection(f"policies[{scheme!r}]", given, "at least one policy")
    if not isinstance(several, Sequence):
        raise InputTypeError(line)
    if not several:
        raise InputError(line)
    if not all(isinstance(policy, TensorDictModuleBase) for policy in several):
        raise InputTypeError(line)
    return several


@dataclass(frozen=True)
class Flights:
    """What the flights of one scheme brought, on the CPU."""

    totals: dict[str, Tensor]
    """Sums over the slots of each episode, as :func:`_per_slot` names them: (learners, episodes)
    float64."""
    slots: TensorDictBase
    """What followed each slot of the first learner's first episodes: (flights, T)."""

    @property
    def earned(self) -> Tensor:
        """By the reward, in each episode, without penalties: (learners, episodes) float64."""
        return self.totals.get("reward", self.totals["secrecy_sum_rate"])


@torch.no_grad()
def fly(
    scenario: Scenario,
    scheme: str,
    policy: TensorDictModuleBase,
    parameters: EvaluationParameters,
    device: torch.device | str | None = None,
    reward: Reward = DEFAULT,
) -> Flights:
    """Fly all learners of a policy through the same episodes, with diagnostics.

    A :class:`hyuav.Policy` flies in the environment that it was trained in, but for the scenario
    and who chooses the mode; any other in that of :func:`hyuav.make_env`. The scenario is as
    :meth:`.schemes.Scheme.flown_in` has it.
    """
    own = SCHEMES[scheme]
    trained_in, learners = {}, 1
    if isinstance(policy, Policy):
        trained_in, learners = policy.environment, policy.learners
    seeds = [derived_seed(parameters.seed, "evaluation")] * learners
    flown_in = own.flown_in(scenario)
    asked = {"scenario": flown_in, "scheme": own.mode_rule, "reward": reward}
    env = make_env(
        **{**trained_in, **asked},
        batch_size=(learners, parameters.episodes),
        device=device,
        seed=seeds,
        diagnostics=True,
    )
    module = policy.to(env.device)
    totals: dict[str, Tensor] = {}
    state, slots = env.reset(), []
    for _ in range(scenario.num_slots):
        flown = env.step(module(state))
        found = _per_slot(flown["next"])
        if reward != DEFAULT:
            earned = flown["next", "reward"]
            off_map = flown["next", "off_map"].sum(dim=-1, keepdim=True, dtype=earned.dtype)
            found["reward"] = (earned + scenario.off_map_penalty * off_map).squeeze(-1)
        for name, values in found.items():
            totals[name] = totals[name] + values if name in totals else values.double()
        kept = flown["next"][0, : parameters.flights].cpu()
        if flown_in.power_control and own.kind is not Kind.NO_HELPER:
            kept["power_level"] = power_level(flown["action"][0, : parameters.flights], flown_in)
        slots.append(kept)
        state = env.step_mdp(flown)
    return Flights(
        {name: values.cpu() for name, values in totals.items()}, torch.stack(slots, dim=1)
    )


def _together(several: Sequence[Flights]) -> Flights:
    """The flights of all learners, with the slots of the first."""
    names = several[0].totals
    totals = {name: torch.cat([flights.totals[name] for flights in several]) for name in names}
    return Flights(totals, several[0].slots)


def _per_slot(after: TensorDictBase) -> dict[str, Tensor]:
    """How the helpers flew and what each node spent in one slot: (learners, episodes).

    Of several helpers it is the sum, and of shares the mean; those of each follow, numbered.
    """
    diagnostics = after["diagnostics"]
    several: dict[str, Tensor] = {}
    if after["mode"].shape[-1] > 1:
        several |= _of_helpers("relay_share", after["mode"].float())
        several |= _of_helpers("off_map", after["off_map"])
        several |= _of_helpers("helper_energy", diagnostics["helper_energy"])
    return {
        "secrecy_sum_rate": secrecy_sum_rate(after),
        "relay_share": after["mode"].float().mean(dim=-1),
        "offloading_share": diagnostics["offloading"].float().mean(dim=-1),
        "off_map": after["off_map"].sum(dim=-1),
        "budget_violations": diagnostics["budget_violation"].squeeze(-1),
        "ue_energy": diagnostics["ue_energy"].mean(dim=-1),
        "edge_energy": diagnostics["edge_energy"].squeeze(-1),
        "helper_energy": diagnostics["helper_energy"].sum(dim=-1),
        **several,
    }


def power_level(action: Tensor, scenario: Scenario) -> Tensor:
    """The power of each helper in dB below the nominal one: (..., H), from actions (..., 3 H)."""
    chosen = action.unflatten(-1, (scenario.num_helpers, -1))[..., 2].clamp(-1.0, 1.0)
    return (scenario.power_range * (chosen - 1.0) / 2).cpu()


def secrecy_sum_rate(flown: TensorDictBase) -> Tensor:
    """The secrecy sum-rate of a slot, without penalty: (...) bps/Hz."""
    return flown["diagnostics", "secrecy_rate"].sum(dim=-1)


def _returns(
    flown: Mapping[str, Flights], scheme: str, upper_bounds: Mapping[str, float]
) -> dict[str, Any]:
    """Mean returns with intervals, and as a fraction of the optima flown in the same draws."""
    returns = {name: flights.earned.numpy() for name, flights in flown.items()}
    mean, best = float(returns[scheme].mean()), SCHEMES[scheme].optimum
    result: dict[str, Any] = {"learners": len(returns[scheme])}
    for name in RETURNS:
        if (own := flown[scheme].totals.get(name)) is not None:
            interval = confidence_interval(own.numpy())
            result[name] = {"mean": float(own.numpy().mean()), "ci95": interval}
    for field, optimum in (
        ("fraction_of_optimum", best),
        ("fraction_of_hybrid_optimum", "optimum"),
    ):
        if optimum in returns and returns[optimum].mean() > 0:
            result[field] = mean / float(returns[optimum].mean())
    if best is not None and (bound := upper_bounds.get(best)) is not None:
        result["upper_bound"] = bound
        if bound > 0:
            result["fraction_of_upper_bound"] = mean / bound
    return result


def confidence_interval(returns: Array) -> list[float]:
    """The 95 % interval of the mean return by Student's t.

    Args:
        returns: (learners, episodes). Where several learners were flown, it is they that the
            interval speaks of; with a single one, or a fixed flight, it speaks of the fading.

    Returns:
        the lower and the upper bound.
    """
    sample = returns.mean(axis=1) if len(returns) > 1 else returns[0]
    if np.ptp(sample) == 0.0:
        return [float(sample.mean())] * 2
    error = sample.std(ddof=1) / math.sqrt(len(sample))
    # Not by scipy.stats, which takes a second to load.
    interval = sample.mean() + error * stdtrit(len(sample) - 1, [0.025, 0.975])
    return [float(bound) for bound in interval]


def _account(totals: Mapping[str, Tensor], scenario: Scenario) -> dict[str, Any]:
    """How the helper flew and what each node spent, per episode; shares are of all slots."""
    per_episode = {name: float(values.mean()) for name, values in totals.items()}
    return {
        name: value / scenario.num_slots if "_share" in name else value
        for name, value in per_episode.items()
        if name not in RETURNS
    }


def slot_table(scheme: str, flown: TensorDictBase) -> pd.DataFrame:
    """Flights (episodes, T) as a table with a row per slot; lists hold one entry per UE.

    With several helpers, whose numbers are columns ``x_1``, ``x_2`` and so on, :data:`WAY` tells
    how each UE sends. Where their power is controlled, ``power_level`` is in dB relative to the
    nominal one.
    """
    episodes, num_slots = flown.batch_size
    diagnostics = flown["diagnostics"]
    columns = {
        "scheme": [scheme] * (episodes * num_slots),
        "episode": np.repeat(np.arange(episodes), num_slots),
        "slot": np.tile(np.arange(1, num_slots + 1), episodes),
        **_of_helpers("x", flown["position"][..., 0]),
        **_of_helpers("y", flown["position"][..., 1]),
        **_of_helpers("relay", flown["mode"] == 1),
        **_of_helpers("off_map", flown["off_map"]),
        "secrecy_sum_rate": secrecy_sum_rate(flown),
        "relay_sum_rate": diagnostics["relay_sum_rate"],
        "jamming_sum_rate": diagnostics["jamming_sum_rate"],
        "edge_energy": diagnostics["edge_energy"],
        **_of_helpers("helper_energy", diagnostics["helper_energy"]),
        "budget_violation": diagnostics["budget_violation"],
    }
    if "power_level" in flown:
        columns |= _of_helpers("power_level", flown["power_level"])
    table = pd.DataFrame(
        {
            name: values.flatten().numpy() if isinstance(values, Tensor) else values
            for name, values in columns.items()
        }
    )
    for name in PER_UE if flown["mode"].shape[-1] == 1 else (*PER_UE, WAY):
        table[name] = diagnostics[name].flatten(0, 1).tolist()
    return table


def _of_helpers(name: str, values: Tensor) -> dict[str, Tensor]:
    """A column of values (..., H) for each helper, numbered where there are several."""
    names = helper_columns(name, values.shape[-1])
    return dict(zip(names, values.unbind(dim=-1), strict=True))


def helper_columns(name: str, num_helpers: int) -> list[str]:
    """What a quantity of the helpers is called in a table: ``x``, or ``x_1``, ``x_2`` of two."""
    if num_helpers == 1:
        return [name]
    return [f"{name}_{number}" for number in range(1, num_helpers + 1)]
