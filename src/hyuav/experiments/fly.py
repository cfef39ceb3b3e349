"""Fly the generalist beside the references and the optimum, without any training."""

from pathlib import Path

from hyuav._support.files import require_writable
from hyuav._support.parameters import PositiveNumber, checked
from hyuav.experiments.evaluation import Evaluation, EvaluationParameters, evaluate
from hyuav.experiments.policies import Policies, straight_policies
from hyuav.experiments.schemes import GENERALISTS, OPTIMA
from hyuav.learning.generalist.pretrained import pretrained
from hyuav.learning.generalist.refine import refined
from hyuav.physics.scenario import Scenario, ScenarioLike, as_scenario
from hyuav.references.optimum import solve_optimum

RESOLUTION, RESOLUTION_OF_SEVERAL = 4.0, 10.0
"""In m, of the grid of the optimum that is shown beside: coarse, so that it takes a second, or
some with several helpers."""

POWER_STEP = 3.0
"""In dB, between the levels of power that are tried there."""

DRAWS, DRAWS_OF_SEVERAL = 32, 4
"""Of fading, over which its expected reward is averaged."""


def usable_resolution(scenario: Scenario, resolution: float | None) -> float:
    """The spacing in m of the optimum's grid, the default where it is None."""
    if resolution is not None:
        return resolution
    return RESOLUTION if scenario.num_helpers == 1 else RESOLUTION_OF_SEVERAL


def fly(
    scenario: ScenarioLike,
    *,
    episodes: int = 100,
    seed: int = 0,
    refine: bool = False,
    resolution: float | None = None,
    output: str | Path | None = None,
    name: str | None = None,
) -> Evaluation:
    """Fly the generalist in a scenario that it has never seen, beside the references.

    It flies under each mode rule, in the same draws as Re-LT, Ja-LT, no helper and the optima.

    Args:
        scenario: node positions and parameters, the name of a preset, or UE positions.
        episodes: of fading and tasks, at least 2.
        seed: of these.
        refine: improve its flights by a local search with the exact model.
        resolution: of the optimum's grid in m; None for :data:`RESOLUTION`, or
            :data:`RESOLUTION_OF_SEVERAL` with several helpers, whose best flight is then the best
            that was found.
        output: directory that keeps the evaluation; None for none.
        name: of the scenario, for the record.

    Returns:
        the evaluation, whose ``summary["schemes"]`` has ``generalist``, ``ja_generalist``,
        ``re_generalist`` and what they are compared with.

    Raises:
        InputError: an unknown preset, an unacceptable value, or a directory that cannot be written.
        InputTypeError: an argument of the wrong type.

    Example:
        >>> hyuav.fly("two_clusters").summary["schemes"]["generalist"]["fraction_of_optimum"]
    """
    told = scenario if isinstance(scenario, str) else "custom"
    scenario = as_scenario(scenario)
    parameters = EvaluationParameters(episodes=episodes, seed=seed)
    checked(bool, "refine", refine)
    spacing = checked(PositiveNumber, "resolution", usable_resolution(scenario, resolution))
    if output is not None:
        require_writable("output", Path(output))
    policies, _ = straight_policies(scenario)
    policies |= generalist_policies(scenario, refine=refine)
    optima = solve_optimum(
        scenario,
        resolution=spacing,
        power_step=POWER_STEP,
        draws=DRAWS if scenario.num_helpers == 1 else DRAWS_OF_SEVERAL,
        evaluation_draws=2,
        certify=False,
    )
    policies |= {OPTIMA[rule]: [optimum.policy] for rule, optimum in optima.items()}
    evaluation = evaluate(scenario, name or told, policies, parameters)
    if output is not None:
        evaluation.save(Path(output))
    return evaluation


def generalist_policies(scenario: Scenario, *, refine: bool) -> Policies:
    """The generalist under each mode rule."""
    policies: Policies = {}
    for rule, scheme in GENERALISTS.items():
        policy = pretrained("generalist").policy(scenario, rule)
        policies[scheme] = [refined(policy) if refine else policy]
    return policies
