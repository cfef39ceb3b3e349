"""Flights that nobody has evaluated: of trained weights, and of the optimum beside them."""

import math
from dataclasses import dataclass
from functools import lru_cache

from torch import Tensor

from hyuav._support.errors import InputError, rejection
from hyuav.experiments.evaluation import Evaluation, EvaluationParameters, evaluate
from hyuav.experiments.policies import (
    Policies,
    learned_policies,
    require_fit,
    straight_policies,
)
from hyuav.experiments.run_directory import RunConfiguration, RunDirectory
from hyuav.experiments.schemes import GENERALISTS, LABELS, LEARNED, NO_HELPER, OPTIMA
from hyuav.learning.generalist.pretrained import pretrained
from hyuav.learning.learners import Learner
from hyuav.learning.policy import Policy
from hyuav.physics.scenario import Scenario
from hyuav.references.optimum import RESOLUTION, Optimum, solve_optimum
from hyuav.references.straight import no_helper
from hyuav.viz.data.index import RunIndex, Stamp

MOST_SLOTS, MOST_UES, MOST_HELPERS = 500, 200, 3
"""Of a scenario that is flown while a person waits; helpers, where the optimum is sought."""

QUICK = EvaluationParameters(episodes=100, flights=1)
"""How runs are flown that nobody has evaluated."""

_FEW = EvaluationParameters(episodes=2, flights=1)

EPISODES = EvaluationParameters(episodes=200, flights=3)
"""Flown of each scheme, and how many of them are shown."""

COARSE_DRAWS, FINE_DRAWS = 64, 256
"""Of the fading and the tasks, from which the optimum is found."""

_COARSE_SPACINGS, _COARSE_OF_SEVERAL, _MOST_SPACINGS = 50, 20, 400
"""Of the grid on each side of the map, for one helper and for several."""


@dataclass(frozen=True)
class Checkpoint:
    """A run's best weights as they were at some time, and one of their learners."""

    run: str
    """The run's directory."""
    stamp: Stamp
    """Of the checkpoint's file: a training may write it anew."""
    index: int
    """Of the learner in the run."""


def checkpoint_of(index: RunIndex, name: str, learner: int) -> Checkpoint:
    """The best weights that a run has now.

    Raises:
        InputError: the run has none below the index's root.
    """
    run = index.run(name)
    state = run.best_checkpoint.stat()
    return Checkpoint(str(run.path), (state.st_mtime_ns, state.st_size), learner)


def learner_label(learner: Learner, scenario: Scenario) -> str:
    """What tells a run's learners apart."""
    return f"{learner.scheme}, T = {learner.horizon(scenario)}, seed {learner.seed}"


def resolution(scenario: Scenario, *, fine: bool) -> float:
    """The grid spacing in m with which the optimum is found.

    The coarse one is a whole fraction of the longest step along an axis in a slot.

    Raises:
        InputError: the helper is too slow, or the scenario too large, to be solved meanwhile.
    """
    _require_size(scenario)
    if scenario.num_helpers > MOST_HELPERS:
        accepted = f"at most {MOST_HELPERS} for the optimum on this page"
        raise InputError(rejection("number of helpers", scenario.num_helpers, accepted))
    step = scenario.max_speed * scenario.slot_duration
    if step * _MOST_SPACINGS < scenario.map_side:
        least = scenario.map_side / (_MOST_SPACINGS * scenario.slot_duration)
        accepted = f"at least {least:.4g} m/s for the optimum on this page"
        raise InputError(rejection("max_speed", scenario.max_speed, accepted))
    spacings = _COARSE_SPACINGS if scenario.num_helpers == 1 else _COARSE_OF_SEVERAL
    coarse = step / math.ceil(step * spacings / scenario.map_side)
    return min(RESOLUTION * scenario.map_side / 200, coarse) if fine else coarse


@lru_cache(maxsize=128)
def optimum(scenario: Scenario, rule: str, *, fine: bool) -> Optimum:
    """The best flight of a scheme, on the coarse grid or on the evaluation's.

    That of several helpers has its upper bound on the latter.

    Args:
        scenario: to fly.
        rule: who chooses the mode.
        fine: whether to take seconds for it.

    Raises:
        InputError: as :func:`resolution`.
    """
    spacing = resolution(scenario, fine=fine)
    draws = FINE_DRAWS if fine else COARSE_DRAWS
    found = solve_optimum(
        scenario,
        [rule],
        resolution=spacing,
        draws=draws,
        evaluation_draws=2000,
        certify=fine and scenario.num_helpers > 1,
    )
    return found[rule]


@lru_cache(maxsize=128)
def flown(
    scenario: Scenario, rule: str, checkpoint: Checkpoint | None = None, *, fine: bool = False
) -> Evaluation:
    """Fly the optimum, the generalist, no helper and a checkpoint through the same fading.

    Args:
        scenario: to fly.
        rule: who chooses the mode.
        checkpoint: whose learner flies under the same rule, if any.
        fine: of the optimum's grid.

    Raises:
        InputError: as :func:`resolution`, or the checkpoint does not fit the scenario.
    """
    best = optimum(scenario, rule, fine=fine)
    policies: Policies = {
        OPTIMA[rule]: [best.policy],
        GENERALISTS[rule]: [pretrained().policy(scenario, rule)],
        NO_HELPER: [no_helper(scenario)],
    }
    if checkpoint is not None:
        policies[LEARNED[rule]] = [_policy(scenario, checkpoint)]
    return evaluate(scenario, "changed", policies, EPISODES)


@lru_cache(maxsize=64)
def flown_by(scenario: Scenario, rule: str, checkpoint: Checkpoint) -> Evaluation:
    """Fly a checkpoint alone, as :func:`flown` does beside the optimum."""
    return evaluate(scenario, "own", {LEARNED[rule]: [_policy(scenario, checkpoint)]}, EPISODES)


def _require_size(scenario: Scenario) -> None:
    """Accept only what is flown while somebody waits."""
    accepted = "a whole number <= {} to be flown on this page"
    if scenario.num_slots > MOST_SLOTS:
        raise InputError(rejection("num_slots", scenario.num_slots, accepted.format(MOST_SLOTS)))
    if scenario.num_ues > MOST_UES:
        raise InputError(rejection("number of UEs", scenario.num_ues, accepted.format(MOST_UES)))


def _policy(scenario: Scenario, checkpoint: Checkpoint) -> Policy:
    _require_size(scenario)
    configuration, weights = _saved(checkpoint.run, checkpoint.stamp)
    policy = configuration.policy(weights, [checkpoint.index])
    require_fit(policy, scenario)
    return policy


@lru_cache(maxsize=8)
def _saved(run: str, stamp: Stamp) -> tuple[RunConfiguration, dict[str, Tensor]]:  # noqa: ARG001
    """What a run keeps; the stamp has a file that was written anew read anew."""
    return RunDirectory(run).trained()


def fly_now(run: RunDirectory, name: str) -> tuple[Scenario, Evaluation]:
    """Fly the best weights and the straight flights through a few episodes.

    Args:
        run: whose weights they are.
        name: of its scenario.

    Returns:
        the scenario, over a horizon for which there are learners, and what came of it.

    Raises:
        InputError: the weights cannot be read, or do not fit.
    """
    configuration = run.configuration()
    scenario = configuration.trained_scenario
    policies = learned_policies([run], scenario)
    policies |= straight_policies(scenario)[0]
    return scenario, evaluate(scenario, name, policies, QUICK, reward=configuration.reward)


def fly_first_learner(run: RunDirectory, configuration: RunConfiguration) -> tuple[str, Evaluation]:
    """Fly the best weights of a run's first scheme through two episodes.

    Args:
        run: whose weights they are.
        configuration: of the run.

    Returns:
        the scheme, and what came of it.

    Raises:
        InputError: the weights cannot be read, or do not fit.
    """
    scenario = configuration.scenario
    policies = learned_policies([run], scenario)
    scheme = next(scheme for scheme in LABELS if scheme in policies)
    own = {scheme: policies[scheme]}
    name, reward = configuration.scenario_name, configuration.reward
    return scheme, evaluate(scenario, name, own, _FEW, reward=reward)
