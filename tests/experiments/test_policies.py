from pathlib import Path

import pytest

from hyuav import Policy
from hyuav.experiments.evaluation import EvaluationParameters, evaluate
from hyuav.experiments.policies import learned_policies, reference_policies
from hyuav.experiments.run_directory import RunDirectory
from hyuav.experiments.train import train
from sample_runs import ONE_OF_EACH, SILENT, UNLOGGED


def test_a_runs_actors_become_the_papers_schemes(tmp_path: Path) -> None:
    run = train(tmp_path / "run", ONE_OF_EACH, UNLOGGED, SILENT)
    policies = learned_policies([run, RunDirectory(tmp_path / "run")], ONE_OF_EACH.scenario)
    assert {
        scheme: sum(each.learners for each in several if isinstance(each, Policy))
        for scheme, several in policies.items()
    } == {
        "proposed": 2,
        "re_ot": 2,
        "ja_ot": 2,
    }


def test_an_actor_earns_in_the_evaluation_what_it_earned_in_training(tmp_path: Path) -> None:
    run = train(tmp_path / "run", ONE_OF_EACH, UNLOGGED, SILENT)
    summary = evaluate(
        ONE_OF_EACH.scenario,
        "two_clusters",
        learned_policies([run], ONE_OF_EACH.scenario),
        EvaluationParameters(episodes=2000),
    ).summary["schemes"]
    best = run.metrics().dropna(subset="best_evaluation").tail(3).set_index("scheme")
    for name, scheme in (("proposed", "hybrid"), ("re_ot", "relay"), ("ja_ot", "jamming")):
        penalty = ONE_OF_EACH.scenario.off_map_penalty * summary[name]["off_map"]
        expected = summary[name]["secrecy_sum_rate"]["mean"] - penalty
        assert best.loc[scheme, "best_evaluation"] == pytest.approx(expected, rel=0.1, abs=0.3)


def test_the_references_of_a_scenario_are_two_straight_flights_and_three_optima() -> None:
    assert set(reference_policies(ONE_OF_EACH.scenario, 5.0, SILENT)) == {
        *("re_lt", "ja_lt", "optimum", "re_optimum", "ja_optimum")
    }
