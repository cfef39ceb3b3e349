"""The ways to fly that an evaluation takes: the actors of trainings, and the references."""

from collections.abc import Mapping, Sequence

from rich.console import Console
from torch import Tensor

from hyuav._support.errors import InputError, rejection
from hyuav._support.terminal import make_progress, print_line
from hyuav.envs.reward import Reward
from hyuav.envs.rewards import DEFAULT
from hyuav.experiments.evaluation import Policy
from hyuav.experiments.run_directory import RunDirectory
from hyuav.experiments.schemes import LABELS, LEARNED, OPTIMA
from hyuav.learning.algorithm import AlgorithmParameters
from hyuav.learning.policy import LearnedPolicy
from hyuav.physics.scenario import Scenario
from hyuav.references.optimum import FlightPolicy, solve_optimum, why_no_optimum
from hyuav.references.straight import ja_lt, re_lt


def learned_policy(
    scenario: Scenario,
    algorithm: AlgorithmParameters,
    weights: dict[str, Tensor],
    learners: Sequence[int],
) -> Policy:
    """The noise-free actors of some learners, in the environment that they were trained in.

    Args:
        scenario: to fly.
        algorithm: with which they were trained.
        weights: of all learners, as a training saves them.
        learners: which of them.

    Raises:
        InputError: the weights do not fit the algorithm or the number of UEs.
    """
    module = LearnedPolicy(scenario, algorithm, weights, learners)
    return Policy(module, len(learners), algorithm.clock, algorithm.geofence)


def learned_policies(
    runs: Sequence[RunDirectory], scenario: Scenario, schemes: Mapping[str, str] = LEARNED
) -> dict[str, list[Policy]]:
    """The best actors of trainings for the scenario's horizon, as Proposed, Re-OT and Ja-OT.

    Args:
        runs: of the trainings.
        scenario: to fly.
        schemes: that the actors count as, by mode rule.

    Raises:
        InputError: a run or its checkpoint cannot be read, its actors observe another number of
            UEs than the scenario has, or none was trained for the horizon.
    """
    policies: dict[str, list[Policy]] = {}
    horizons: set[int] = set()
    for run in runs:
        configuration, weights = run.trained()
        by_scheme: dict[str, list[int]] = {}
        for index, learner in enumerate(configuration.learners):
            horizon = learner.num_slots or configuration.scenario.num_slots
            horizons.add(horizon)
            if horizon == scenario.num_slots:
                by_scheme.setdefault(schemes[learner.scheme], []).append(index)
        for scheme, indices in by_scheme.items():
            policy = learned_policy(scenario, configuration.algorithm, weights, indices)
            policies.setdefault(scheme, []).append(policy)
    if not policies:
        accepted = f"what learners were trained for, {', '.join(map(str, sorted(horizons)))}"
        raise InputError(rejection("num_slots", scenario.num_slots, accepted))
    return policies


def straight_policies(scenario: Scenario) -> tuple[dict[str, list[Policy]], list[str]]:
    """Re-LT and Ja-LT, and a line for each that is too fast for the scenario and left out."""
    policies, left_out = {}, []
    for name, straight in {"re_lt": re_lt, "ja_lt": ja_lt}.items():
        try:
            policies[name] = [Policy(straight(scenario))]
        except InputError as error:
            left_out.append(f"{LABELS[name]} is left out: {error}")
    return policies, left_out


def reference_policies(
    scenario: Scenario, resolution: float | None, console: Console, reward: Reward = DEFAULT
) -> dict[str, list[Policy]]:
    """Re-LT, Ja-LT and the exact optimum of each mode rule, where there is one.

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
    with make_progress(console, "optima") as progress:
        optima = solve_optimum(scenario, resolution=resolution, track=progress.track, reward=reward)
    for rule, optimum in optima.items():
        policies[OPTIMA[rule]] = [Policy(FlightPolicy(optimum.path, scenario))]
    return policies
