import dataclasses
from pathlib import Path
from typing import Any

import pytest
from torch import nn

from hyuav import InputError, Policy
from hyuav.experiments.evaluation import EvaluationParameters, evaluate
from hyuav.experiments.policies import learned_policies, references, require_fit
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


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        ({"ue_positions": ((0.0, 0.0),)}, "number of UEs = 1: expected 10"),
        ({"helper_starts": ((0.0, 0.0), (9.0, 0.0))}, "number of helpers = 2: expected 1"),
        ({"eavesdropper_positions": ((0.0, 0.0),) * 3}, "number of eavesdroppers = 3: expected 1"),
        ({"power_control": True}, "power_control = True: expected False"),
    ],
)
def test_a_scenario_in_which_a_policy_cannot_fly_is_refused(
    changes: dict[str, Any], line: str
) -> None:
    policy, scenario = Policy(nn.Linear(15, 2), ONE_OF_EACH.scenario), ONE_OF_EACH.scenario
    require_fit(policy, scenario)
    with pytest.raises(InputError, match=f"^{line}, for which the checkpoint was trained$"):
        require_fit(policy, dataclasses.replace(scenario, **changes))


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


def test_the_references_are_two_straight_flights_no_helper_and_the_optima() -> None:
    fixed = {"re_lt", "ja_lt", "no_helper", "optimum", "re_optimum", "ja_optimum"}
    scenario = ONE_OF_EACH.scenario
    assert set(references(scenario, 10.0, SILENT)) == {*fixed, "optimum_power"}
    controlled = dataclasses.replace(scenario, power_control=True)
    assert set(references(controlled, 20.0, SILENT)) == fixed
