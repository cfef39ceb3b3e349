"""That the algorithms learn: short trainings of small networks."""

import dataclasses

import pytest
import torch
from scipy import stats

from hyuav import Scenario
from hyuav.learning.learners import Learner
from hyuav.learning.registry import ALGORITHMS
from hyuav.learning.training import Training, TrainingParameters
from hyuav.references.optimum import solve_optimum

EASY = dataclasses.replace(
    Scenario.preset("two_clusters"), helper_starts=((20.0, 20.0),), num_slots=10, fading=False
)
"""Jamming pays within two slots of the start: a small network finds it in few episodes."""


NAMES = sorted(set(ALGORITHMS) - {"maddpg"})
"""Without the one that is DDPG where there is one helper."""

FAST = "ddpg_robust"
"""The one of them that learns in every run of the tests."""


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[] if name == FAST else pytest.mark.slow) for name in NAMES]
)
def test_a_short_training_earns_most_of_the_optimum(name: str) -> None:
    torch.set_num_threads(1)
    robust = name.endswith("robust")
    rate, warm_up = (3e-3, 10) if name == FAST else (1e-3, 20)
    rates = {"actor_learning_rate": rate, "critic_learning_rate": rate}
    guided = {"guide": {"warm_up_episodes": warm_up}} if robust else {}
    algorithm = ALGORITHMS[name].from_dict({"hidden_sizes": [64, 64], **rates, **guided})
    parameters = TrainingParameters(
        num_episodes=80 * (1 + robust),  # some of which are flown at random
        batch_size=64,
        evaluation_every=5,
        evaluation_episodes=1,
    )
    training = Training(EASY, [Learner("jamming", i) for i in range(3)], algorithm, parameters)
    optimum = solve_optimum(EASY, ["jamming"], resolution=2.0)["jamming"].value
    assert any(
        training.best_evaluation.median().item() > 0.85 * optimum for _ in training.episodes()
    )


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_learning_curves_do_not_depend_on_how_fast_they_are_made(name: str) -> None:
    """Compiled and side by side, or eager and alone: the same seeds learn the same, in the mean.

    Rounding differs, and grows in the course of a training until single episodes differ. So it
    is the curves' means over many episodes and seeds that are compared.
    """
    torch.set_num_threads(1)
    algorithm = ALGORITHMS[name](hidden_sizes=(64, 64), actor_learning_rate=1e-3)
    learners = [Learner("hybrid", seed) for seed in range(8)]
    parameters = TrainingParameters(num_episodes=45, evaluation_every=45, evaluation_episodes=20)

    def curves(group: list[Learner], how: str) -> torch.Tensor:
        changed = dataclasses.replace(parameters, compile=how)
        episodes = Training(EASY, group, algorithm, changed).episodes()
        return torch.stack([episode.accumulated_reward for episode in episodes])

    fast = curves(learners, "always")
    eager = torch.cat([curves([learner], "never") for learner in learners], dim=1)
    torch.testing.assert_close(fast[:8], eager[:8], rtol=0.05, atol=0.05)  # hardly any updates yet
    for part in (slice(0, 15), slice(15, 30), slice(30, 45)):
        one, other = (each[part].mean(dim=0).numpy() for each in (fast, eager))
        low, high = stats.t.interval(0.95, len(one) - 1, one.mean(), stats.sem(one))
        assert low <= other.mean() <= high


@pytest.mark.slow
def test_every_seed_of_the_robust_variant_learns_the_power() -> None:
    """The best power is some 30 dB below the nominal one, which earns less than none at all."""
    torch.set_num_threads(1)
    preset = Scenario.preset("two_clusters")
    scenario = dataclasses.replace(preset, num_slots=10, fading=False, power_control=True)
    parameters = TrainingParameters(num_episodes=200, evaluation_every=5, evaluation_episodes=1)
    training = Training(scenario, range(3), ALGORITHMS["ddpg_robust"](), parameters)
    list(training.episodes())
    optimum = solve_optimum(scenario, ["hybrid"], resolution=5.0, power_step=3.0)["hybrid"].value
    assert (training.best_evaluation > 0.95 * optimum).all()


@pytest.mark.slow
def test_every_seed_of_the_robust_variant_leads_two_helpers_to_two_eavesdroppers() -> None:
    """Without a helper nothing is secret, and a single one earns a tenth of what two earn."""
    torch.set_num_threads(1)
    contested = Scenario.preset("contested")
    scenario = dataclasses.replace(contested, num_slots=10, fading=False)
    parameters = TrainingParameters(num_episodes=200, evaluation_every=5, evaluation_episodes=1)
    training = Training(scenario, range(3), ALGORITHMS["ddpg_robust"](), parameters)
    list(training.episodes())
    optimum = 183.64  # solve_optimum(scenario, ["hybrid"], resolution=2.0)
    assert (training.best_evaluation > 0.95 * optimum).all()


@pytest.mark.slow
@pytest.mark.parametrize("num_slots", [10, 20])
def test_every_seed_of_the_robust_variant_finds_the_far_region(num_slots: int) -> None:
    """Jamming pays only beyond the eavesdropper, five slots without a reward away."""
    torch.set_num_threads(1)
    scenario = dataclasses.replace(Scenario.preset("two_clusters"), num_slots=num_slots)
    learners = [Learner(scheme, seed) for scheme in ("hybrid", "jamming") for seed in (100, 101)]
    parameters = TrainingParameters(num_episodes=250, evaluation_every=5)
    training = Training(scenario, learners, ALGORITHMS["ddpg_robust"](), parameters)
    earned = torch.stack(
        [
            episode.evaluation.sum_rate
            for episode in training.episodes()
            if episode.evaluation is not None
        ]
    )
    optima = solve_optimum(scenario, ["hybrid", "jamming"])
    best = torch.tensor([optima[learner.scheme].value for learner in learners])
    assert bool((earned.amax(dim=0) > 0.95 * best).all())
