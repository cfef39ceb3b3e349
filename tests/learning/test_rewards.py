"""Learning of something else than the secrecy sum-rate."""

import copy
import dataclasses
from typing import Any

import pytest
import torch

from hyuav import InputError, Learner, Scenario, Training, TrainingParameters, make_env
from hyuav.envs.rewards import DEFAULT, as_reward
from hyuav.learning.guide.parameters import Guide
from hyuav.learning.registry import ALGORITHMS
from hyuav.learning.train import Cohort

SCENARIO = dataclasses.replace(
    Scenario.preset("two_clusters"), num_slots=5, helper_starts=((0.0, 0.0),)
)
SHORT = TrainingParameters(
    num_episodes=4,
    replay_size=30,
    batch_size=8,
    evaluation_every=4,
    evaluation_episodes=3,
    compile="never",
)
WITHOUT = Guide(warm_up_episodes=1, update_every=2, repeat_every=2, imagined_flights=0)


def training(reward: Any, name: str = "ddpg", **options: Any) -> Training:
    algorithm = ALGORITHMS[name](hidden_sizes=(12, 8), **options)
    return Training(SCENARIO, [Learner("hybrid", 1)], algorithm, SHORT, reward=reward)


@pytest.mark.parametrize("reward", ["secrecy_energy_efficiency", "proportional_fairness"])
def test_what_is_learned_is_what_is_earned(reward: str) -> None:
    trained = training(reward)
    *_, last = trained.episodes()
    cohort = trained.cohorts[0]
    again = make_env(SCENARIO, "hybrid", 1, seed=[1], reward=reward)
    earned: list[torch.Tensor] = []
    for _ in range(4):
        state = again.reset()
        for _slot in range(5):
            action = cohort.replay[:]["action"][len(earned), :, :]
            flown = again.step(state.set("action", action))
            earned.append(flown["next", "reward"].flatten())
            state = again.step_mdp(flown)
    stored = cohort.replay[:]["next", "reward"][:20, :, 0]
    torch.testing.assert_close(stored, torch.stack(earned))
    assert last.accumulated_reward == pytest.approx(float(stored[-5:].sum()), rel=1e-4)


def test_the_sum_rate_is_told_beside_what_actors_earn() -> None:
    plain, other = training("sum_rate"), training("proportional_fairness")
    told = [own.evaluate() for own in (plain, other)]  # by the same weights
    torch.testing.assert_close(told[0].sum_rate, told[1].sum_rate)
    assert float(told[0].sum_rate) > 0.0
    assert float(told[0].reward) != float(told[1].reward)


def test_a_training_goes_on_within_the_objective() -> None:
    whole, broken = training("proportional_fairness"), training("proportional_fairness")
    next(episodes := broken.episodes())
    state = copy.deepcopy(broken.state_dict())
    episodes.close()  # type: ignore[attr-defined]
    continued = training("proportional_fairness")
    continued.load_state_dict(state)
    *_, expected = whole.episodes()
    *_, found = continued.episodes()
    assert torch.equal(found.accumulated_reward, expected.accumulated_reward)


@pytest.mark.parametrize(
    ("reward", "options", "line"),
    [
        ("secrecy_energy_efficiency", {}, "algorithm.afterstate = True: expected false, because"),
        (
            "secrecy_energy_efficiency",
            {"afterstate": False},
            "algorithm.guide.imagined_flights = 64: expected 0, because reward = secrecy_energy",
        ),
        ("proportional_fairness", {}, "algorithm.guide.imagined_flights = 64: expected 0"),
        (lambda slot: slot.sum_rate.mean(), {}, "reward = '<lambda>': expected a function"),
    ],
)
def test_what_a_robust_variant_cannot_do_is_refused_in_one_line(
    reward: Any, options: dict[str, Any], line: str
) -> None:
    with pytest.raises(InputError, match=f"^{line}[^\n]*$"):
        training(reward, "ddpg_robust", **options)


def test_flights_then_count_what_they_earned_less_what_was_chance() -> None:
    trained = training("proportional_fairness", "ddpg_robust", guide=WITHOUT)
    for _ in trained.episodes():
        pass
    guide: Any = trained.cohorts[0].algorithm.guide
    stored = trained.cohorts[0].stored
    flown = stored[15:20]
    term = guide.control_term(flown.transpose(0, 1)).transpose(0, 1)
    assert term.abs().max() > 0.0
    last = (flown["next", "reward"] - term).sum()
    assert guide.flights.best_return >= last - 1e-5
    assert guide.flights.actions.isfinite().all()


def test_where_the_place_is_all_that_counts_the_whole_guide_is_at_work() -> None:
    def served(slot: Any) -> torch.Tensor:
        found: torch.Tensor = slot.offloading.float().mean(dim=-1, keepdim=True)
        return found

    trained = training(served, "ddpg_robust")
    assert isinstance(trained.cohorts[0], Cohort)
    assert trained.cohorts[0].env.base_env.reward.depends_on == "position"
    assert "guesses" in trained.cohorts[0].algorithm.guide.streams
    assert as_reward("sum_rate") is DEFAULT
