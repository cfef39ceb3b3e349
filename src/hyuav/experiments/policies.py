"""The ways to fly that an evaluation takes: the actors of trainings, and the references."""

from collections.abc import Mapping, Sequence
from typing import Any

from rich.console import Console
from tensordict.nn import TensorDictModuleBase

from hyuav._support.errors import InputError, rejection
from hyuav._support.terminal import make_progress, print_line
from hyuav.envs.reward import Reward
from hyuav.envs.rewards import DEFAULT
from hyuav.experiments.run_directory import RunDirectory
from hyuav.experiments.schemes import (
    LABELS,
    LEARNED,
    NO_HELPER,
    OPTIMA,
    OPTIMUM_POWER,
    SCHEMES,
)
from hyuav.learning.policy import Policy
from hyuav.physics.scenario import Scenario
from hyuav.references.objectives import why_no_optimum
from hyuav.references.optimum import RESOLUTION, solve_optimum
from hyuav.references.straight import ja_lt, no_helper, re_lt

POWER_RESOLUTION = 2.0
"""Of the grid in m, at the finest, on which all powers are tried at each place."""

Policies = dict[str, list[TensorDictModuleBase]]
"""By scheme."""


def require_fit(policy: Policy, scenario: Scenario) -> None:
    """Accept a scenario in which a policy observes and steers as much as where it was trained.

    Raises:
        InputError: it has another number of UEs, helpers or eavesdroppers, or another control.
    """
    trained_on: Scenario = policy.environment["scenario"]
    for name, own, other in (
        ("number of UEs", trained_on.num_ues, scenario.num_ues),
        ("number of helpers", trained_on.num_helpers, scenario.num_helpers),
        ("number of eavesdroppers", trained_on.num_eavesdroppers, scenario.num_eavesdroppers),
        ("power_control", trained_on.power_control, scenario.power_control),
    ):
        if own != other:
            accepted = f"{own}, for which the checkpoint was trained"
            raise InputError(rejection(name, other, accepted))


def learned_policies(
    runs: Sequence[RunDirectory],
    scenario: Scenario,
    schemes: Mapping[str, str] = LEARNED,
    *,
    num_slots: int | None = None,
) -> Policies:
    """The best actors of trainings for a horizon, as Proposed, Re-OT and Ja-OT.

    Args:
        runs: of the trainings.
        scenario: to fly.
        schemes: that the actors count as, by mode rule.
        num_slots: horizon that the actors were trained for; the scenario's where it is None.

    Raises:
        InputError: a run or its checkpoint cannot be read, its actors observe another number of
            UEs than the scenario has, or none was trained for the horizon.
    """
    policies: Policies = {}
    horizons: set[int] = set()
    wanted = num_slots or scenario.num_slots
    for run in runs:
        configuration, weights = run.trained()
        horizons.update(configuration.horizons)
        by_scheme: dict[str, list[int]] = {}
        for index, learner in enumerate(configuration.learners):
            if configuration.horizons[index] == wanted:
                by_scheme.setdefault(schemes[learner.scheme], []).append(index)
        for scheme, indices in by_scheme.items():
            policy = configuration.policy(weights, indices)
            require_fit(policy, scenario)
            policies.setdefault(scheme, []).append(policy)
    if not policies:
        accepted = f"what learners were trained for, {', '.join(map(str, sorted(horizons)))}"
        raise InputError(rejection("num_slots", wanted, accepted))
    return policies


def straight_policies(scenario: Scenario) -> tuple[Policies, list[str]]:
    """Re-LT, Ja-LT and no helper, and a line for each that is too fast for the scenario.

    What is too fast is left out.
    """
    policies: Policies = {NO_HELPER: [no_helper(scenario)]}
    left_out = []
    for name, straight in {"re_lt": re_lt, "ja_lt": ja_lt}.items():
        try:
            policies[name] = [straight(scenario)]
        except InputError as error:
            left_out.append(f"{LABELS[name]} is left out: {error}")
    return policies, left_out


def references(
    scenario: Scenario, resolution: float | None, console: Console, reward: Reward = DEFAULT
) -> Policies:
    """Re-LT, Ja-LT, no helper, and the optimum of each mode rule, where there is one.

    Of one helper it is exact on a grid; of several it is the best flight that was found, and the
    upper bound tells how much better another one may be. One helper whose power is nominal is set
    beside the hybrid optimum with chosen power, too.

    Args:
        scenario: to fly.
        resolution: of the optimum's grid in m; None for the default.
        console: for what is left out, and for the progress.
        reward: of which it is the optimum.
    """
    policies, left_out = straight_policies(scenario)
    for line in left_out:
        print_line(line, console)
    if (reason := why_no_optimum(reward, scenario)) is not None:
        print_line(f"reward = {reward.name}: {reason}", console)
        return policies
    # Bounds build on what flights earn in the mean; of one helper only the flights are taken.
    few: dict[str, Any] = {"evaluation_draws": 2} if scenario.num_helpers == 1 else {}
    with make_progress(console, "optima") as progress:
        optima = solve_optimum(
            scenario, resolution=resolution, track=progress.track, reward=reward, **few
        )
    for rule, optimum in optima.items():
        policies[OPTIMA[rule]] = [optimum.policy]
    if scenario.num_helpers == 1 and not scenario.power_control and reward == DEFAULT:
        controlled = SCHEMES[OPTIMUM_POWER].flown_in(scenario)
        spacing = max(resolution or RESOLUTION, POWER_RESOLUTION)
        with make_progress(console, "optimum, power") as progress:
            found = solve_optimum(
                controlled, ["hybrid"], resolution=spacing, track=progress.track, **few
            )
        policies[OPTIMUM_POWER] = [found["hybrid"].policy]
    return policies
