import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import torch
from rich.console import Console
from scipy import stats
from torch import nn

from batches import TEN_UES
from hyuav import InputError, InputTypeError, Policy, Scenario
from hyuav.experiments.evaluation import (
    EvaluationParameters,
    confidence_interval,
    evaluate,
    fly,
    secrecy_sum_rate,
)
from hyuav.experiments.policies import Policies, references
from hyuav.experiments.schemes import LABELS, OPTIMA
from hyuav.learning.ddpg import DDPG
from hyuav.learning.guide.robust import RobustTD3
from hyuav.learning.policy import learned_policy
from hyuav.learning.weights import copy_weights
from hyuav.references.flight import FlightPolicy
from hyuav.references.optimum import solve_optimum
from hyuav.references.straight import ja_lt, no_helper, re_lt

SCENARIO = dataclasses.replace(Scenario.preset("two_clusters"), num_slots=10)
FEW = EvaluationParameters(episodes=40, flights=2, seed=5)


@pytest.fixture(scope="module")
def policies() -> Policies:
    algorithm = DDPG(hidden_sizes=(8,))
    weights = copy_weights(algorithm.build(2, TEN_UES).loss)
    optima = solve_optimum(SCENARIO, resolution=2.0)
    return {
        "re_lt": [re_lt(SCENARIO)],
        "ja_lt": [ja_lt(SCENARIO)],
        "no_helper": [no_helper(SCENARIO)],
        "proposed": [learned_policy(SCENARIO, algorithm, weights, range(2))],
        **{OPTIMA[rule]: [optimum.policy] for rule, optimum in optima.items()},
    }


def test_the_summary_has_the_promised_fields(policies: Policies) -> None:
    summary = evaluate(SCENARIO, "two_clusters", policies, FEW).summary
    assert summary["scenario"] == "two_clusters"
    assert (summary["num_slots"], summary["episodes"]) == (10, 40)
    assert list(summary["schemes"]) == [scheme for scheme in LABELS if scheme in policies]
    for result in summary["schemes"].values():
        low, high = result["secrecy_sum_rate"]["ci95"]
        assert low < result["secrecy_sum_rate"]["mean"] < high
        assert {"relay_share", "offloading_share", "off_map", "budget_violations"} <= set(result)
        assert {"ue_energy", "edge_energy", "helper_energy"} <= set(result)
    assert summary["schemes"]["optimum"]["fraction_of_optimum"] == 1.0
    assert json.loads(json.dumps(summary)) == summary


def test_a_fixed_mode_scheme_is_measured_against_its_own_optimum_and_the_hybrid_one(
    policies: Policies,
) -> None:
    schemes = evaluate(SCENARIO, "two_clusters", policies, FEW).summary["schemes"]
    mean = {name: result["secrecy_sum_rate"]["mean"] for name, result in schemes.items()}
    jamming = schemes["ja_lt"]
    assert jamming["fraction_of_optimum"] == mean["ja_lt"] / mean["ja_optimum"]
    assert jamming["fraction_of_hybrid_optimum"] == mean["ja_lt"] / mean["optimum"]


@pytest.mark.parametrize(
    ("preset", "a_slot", "best_hybrid"),
    [("random_disk", 18.5203, 60.183), ("two_clusters", 19.4288, 59.083)],
)
def test_without_a_helper_the_papers_presets_bring_six_times_the_best_hybrid_flight(
    preset: str, a_slot: float, best_hybrid: float
) -> None:
    scenario = dataclasses.replace(Scenario.preset(preset), fading=False)
    found = evaluate(scenario, preset, {"no_helper": no_helper(scenario)}, FEW).summary["schemes"]
    mean = found["no_helper"]["secrecy_sum_rate"]["mean"]
    assert mean == pytest.approx(20 * a_slot, abs=2e-3)
    assert mean > 6 * best_hybrid
    assert found["no_helper"]["helper_energy"] == 0.0


def test_what_comes_without_a_helper_is_told_as_a_share_of_the_hybrid_optimum(
    policies: Policies,
) -> None:
    beside = {"optimum": policies["optimum"], "no_helper": no_helper(SCENARIO)}
    schemes = evaluate(SCENARIO, "two_clusters", beside, FEW).summary["schemes"]
    mean = {name: result["secrecy_sum_rate"]["mean"] for name, result in schemes.items()}
    alone = schemes["no_helper"]
    assert alone["fraction_of_hybrid_optimum"] == mean["no_helper"] / mean["optimum"]
    assert "fraction_of_optimum" not in alone


def test_all_schemes_fly_through_the_same_fading() -> None:
    everywhere = SCENARIO.helper_starts[0]
    still = dataclasses.replace(SCENARIO, eavesdropper_positions=(everywhere,))
    hovering = ja_lt(still)
    few = EvaluationParameters(episodes=5, flights=5, seed=3)
    twice = [fly(still, scheme, hovering, few).slots for scheme in ("ja_lt", "optimum")]
    for rates in ("relay_sum_rate", "jamming_sum_rate"):
        first, second = (flown["diagnostics", rates] for flown in twice)
        assert torch.equal(first, second)


def test_all_learners_fly_through_the_same_fading() -> None:
    algorithm = DDPG(hidden_sizes=(8,))
    weights = copy_weights(algorithm.build(1, TEN_UES).loss)
    twins = learned_policy(SCENARIO, algorithm, weights, [0, 0])
    first, second = fly(SCENARIO, "proposed", twins, FEW).totals["secrecy_sum_rate"]
    assert torch.equal(first, second)


def test_a_learner_earns_among_others_what_it_earns_alone() -> None:
    algorithm = DDPG(hidden_sizes=(8,))
    weights = copy_weights(algorithm.build(3, TEN_UES).loss)
    among = learned_policy(SCENARIO, algorithm, weights, [2, 0])
    alone = learned_policy(SCENARIO, algorithm, weights, [0])
    torch.testing.assert_close(
        fly(SCENARIO, "proposed", among, FEW).totals["secrecy_sum_rate"][1:],
        fly(SCENARIO, "proposed", alone, FEW).totals["secrecy_sum_rate"],
    )


def test_the_totals_are_sums_over_the_slots_of_an_episode() -> None:
    every = EvaluationParameters(episodes=6, flights=6)
    flown = fly(SCENARIO, "optimum", re_lt(SCENARIO), every)
    diagnostics = flown.slots["diagnostics"]
    for name, per_slot in (
        ("secrecy_sum_rate", secrecy_sum_rate(flown.slots)),
        ("relay_share", flown.slots["mode"].squeeze(-1)),
        ("offloading_share", diagnostics["offloading"].double().mean(dim=-1)),
        ("ue_energy", diagnostics["ue_energy"].mean(dim=-1)),
        ("helper_energy", diagnostics["helper_energy"].squeeze(-1)),
    ):
        expected = per_slot.double().sum(dim=-1)
        torch.testing.assert_close(flown.totals[name][0], expected, rtol=1e-5, atol=1e-6)


def test_the_secrecy_sum_rate_is_that_of_the_mode_flown_without_penalty() -> None:
    leaving = dataclasses.replace(SCENARIO, eavesdropper_positions=((-100.0, -100.0),))
    policy = ja_lt(dataclasses.replace(leaving, num_slots=3))
    flown = fly(leaving, "ja_lt", policy, EvaluationParameters(episodes=4, flights=4)).slots
    assert flown["off_map"].any()
    torch.testing.assert_close(
        secrecy_sum_rate(flown), flown["diagnostics", "jamming_sum_rate"].squeeze(-1)
    )


def test_a_preset_and_one_policy_are_enough() -> None:
    one = evaluate("two_clusters", "", {"re_lt": re_lt("two_clusters")}, FEW)
    named = Scenario.preset("two_clusters")
    several = evaluate(named, "", {"re_lt": [re_lt(named)]}, FEW)
    assert one.summary == several.summary


@pytest.mark.parametrize(
    ("place", "value", "line"),
    [
        (0, 3, "scenario = 3: expected a Scenario, a preset's name or UE positions"),
        (2, [], r"policies = \[\]: expected names with values"),
        (2, {"re_lt": 3}, r"policies\['re_lt'\] = 3: expected at least one policy"),
        (2, {"re_lt": ["x"]}, r"policies\['re_lt'\] = \['x'\]: expected at least one policy"),
        (3, {"episodes": 2}, r"parameters = {'episodes': 2}: expected EvaluationParameters\("),
    ],
)
def test_a_wrong_type_is_told_in_one_line(place: int, value: Any, line: str) -> None:
    arguments: list[Any] = [SCENARIO, "", {"re_lt": re_lt(SCENARIO)}, FEW]
    arguments[place] = value
    with pytest.raises(InputTypeError, match=line):
        evaluate(*arguments)


def test_flights_are_kept_a_row_per_slot(policies: Policies, tmp_path: Path) -> None:
    evaluation = evaluate(SCENARIO, "two_clusters", policies, FEW)
    evaluation.save(tmp_path)
    flights = pd.read_parquet(tmp_path / "flights.parquet")
    assert len(flights) == len(policies) * 2 * 10
    row = flights[(flights.scheme == "re_lt") & (flights.episode == 1) & (flights.slot == 10)]
    assert len(row) == 1
    assert row.relay.item()
    assert len(row.offloading.item()) == SCENARIO.num_ues
    assert row.secrecy_sum_rate.item() == pytest.approx(sum(row.secrecy_rate.item()), rel=1e-5)
    assert json.loads((tmp_path / "evaluation.json").read_text())["episodes"] == 40


def test_the_interval_of_one_learner_speaks_of_the_episodes() -> None:
    returns = np.random.default_rng(0).normal(50, 3, (1, 200))
    low, high = confidence_interval(returns)
    half_width = stats.t.ppf(0.975, 199) * returns.std(ddof=1) / np.sqrt(200)
    assert (low, high) == pytest.approx((returns.mean() - half_width, returns.mean() + half_width))


def test_the_interval_of_several_learners_speaks_of_the_learners() -> None:
    generator = np.random.default_rng(0)
    returns = generator.normal(50, 5, (6, 1)) + generator.normal(0, 0.1, (6, 400))
    low, high = confidence_interval(returns)
    assert high - low > 4.0  # without the learners it would be 0.04


def test_the_interval_of_a_flight_without_fading_is_its_value() -> None:
    assert confidence_interval(np.full((1, 10), 7.0)) == [7.0, 7.0]


class Leaving(nn.Module):
    """Fly to the map's corner and beyond."""

    def forward(self, observation: torch.Tensor) -> torch.Tensor:
        return -torch.ones_like(observation[..., :2])


def test_a_policy_is_evaluated_in_the_environment_that_it_was_trained_in() -> None:
    algorithm = RobustTD3(hidden_sizes=(8,))
    weights = copy_weights(algorithm.build(1, TEN_UES).loss)
    fenced = fly(SCENARIO, "proposed", learned_policy(SCENARIO, algorithm, weights), FEW)
    assert fenced.slots["observation"].shape[-1] == 16
    for geofence in (True, False):
        policy = Policy(Leaving(), SCENARIO, geofence=geofence)
        assert fly(SCENARIO, "proposed", policy, FEW).slots["off_map"].any() != geofence


def test_one_policy_is_taken_as_several_are() -> None:
    straight = re_lt(SCENARIO)
    one, several = (
        evaluate(SCENARIO, "two_clusters", {"re_lt": given}, FEW).summary
        for given in (straight, (straight,))
    )
    assert one == several


def test_a_policy_of_another_number_of_ues_is_refused_in_one_line() -> None:
    fewer = dataclasses.replace(SCENARIO, ue_positions=SCENARIO.ue_positions[1:])
    policy = Policy(nn.Linear(15, 2), SCENARIO)
    with pytest.raises(InputError, match=r"observation = \(1, 40, 14\): .* 10 UEs, .* clock=False"):
        evaluate(fewer, "fewer", {"proposed": policy}, FEW)


def test_an_unknown_scheme_or_none_is_refused() -> None:
    straight = re_lt(SCENARIO)
    refused: list[Any] = [{}, {"proposed": []}, {"foo": [straight]}]
    refused += [{"proposed": given} for given in (None, "policy.pt", ["policy.pt"], {1: straight})]
    for policies in refused:
        with pytest.raises(InputError):
            evaluate(SCENARIO, "two_clusters", policies, FEW)


@pytest.mark.parametrize(
    ("name", "places", "ways"),
    [
        ("two_eavesdroppers", ((-47.0, 48.0), (40.0, -23.0)), {1, 2}),
        ("contested", ((-60.0, -50.0), (60.0, 55.0)), {0}),
    ],
)
def test_several_helpers_have_columns_of_their_own(
    name: str, places: tuple[tuple[float, float], ...], ways: set[int]
) -> None:
    two = dataclasses.replace(
        Scenario.preset(name), helper_starts=places, num_slots=3, fading=False
    )
    path = torch.tensor(places).expand(4, 2, 2)
    flights = evaluate(two, name, {"optimum": FlightPolicy(path, two)}, FEW).flights
    names = {f"{name}_{helper}" for name in ("x", "y", "relay", "off_map") for helper in (1, 2)}
    assert names | {"helper_energy_1", "helper_energy_2", "way"} < set(flights.columns)
    assert {"x", "relay", "helper_energy"}.isdisjoint(flights.columns)
    assert (flights["x_2"] == places[1][0]).all()
    assert (flights["relay_1"] == (ways != {0})).all()
    for way, offloads in zip(flights["way"], flights["offloading"], strict=True):
        assert {own for own, sends in zip(way, offloads, strict=True) if sends} <= ways
        assert any(offloads)


@pytest.mark.parametrize("power_control", [False, True])
def test_a_flight_of_one_place_hovers_there(power_control: bool) -> None:
    scenario = dataclasses.replace(SCENARIO, power_control=power_control)
    policy = FlightPolicy([scenario.helper_starts], scenario)
    flights = evaluate(scenario, "hovering", {"optimum": policy}, FEW).flights
    assert set(zip(flights["x"], flights["y"], strict=True)) == set(scenario.helper_starts)


def test_what_helpers_do_together_is_made_of_what_each_does() -> None:
    two = dataclasses.replace(Scenario.preset("two_eavesdroppers"), num_slots=4)
    path = torch.tensor(two.helper_starts).expand(5, 2, 2).clone()
    path[:, 0, 0] -= 20.0 * torch.arange(5)  # the edge turns it back twice
    flown = evaluate(two, "two", {"ja_lt": FlightPolicy(path, two)}, FEW).summary["schemes"]
    found = flown["ja_lt"]
    for name, whole in (("relay_share", 0.5), ("off_map", 1.0), ("helper_energy", 1.0)):
        assert found[name] == pytest.approx(whole * (found[f"{name}_1"] + found[f"{name}_2"]))
    assert (found["off_map_1"], found["off_map_2"]) == (2.0, 0.0)
    assert found["helper_energy_1"] > found["helper_energy_2"] > 0.0


def test_the_optimum_flies_with_the_power_that_was_chosen() -> None:
    scenario = dataclasses.replace(SCENARIO, power_control=True, power_range=30.0, fading=False)
    policies = references(scenario, 10.0, Console(quiet=True))
    found = evaluate(scenario, "power", policies, FEW).summary["schemes"]
    best = solve_optimum(scenario, resolution=10.0)
    for scheme, rule in (("optimum", "hybrid"), ("ja_optimum", "jamming")):
        mean = found[scheme]["secrecy_sum_rate"]["mean"]
        assert mean == pytest.approx(best[rule].value, rel=1e-4)
    assert found["optimum"]["secrecy_sum_rate"]["mean"] > found["re_lt"]["secrecy_sum_rate"]["mean"]


def test_the_power_along_the_flight_is_kept_where_a_scheme_chooses_it() -> None:
    controlled = dataclasses.replace(SCENARIO, power_control=True)
    path = torch.tensor(SCENARIO.helper_starts).expand(SCENARIO.num_slots + 1, 1, 2)
    share = torch.logspace(0.0, -6.0, SCENARIO.num_slots).unsqueeze(1)  # all of the range
    flying = {
        "re_lt": re_lt(SCENARIO),
        "optimum_power": FlightPolicy(path, controlled, share),
    }
    found = evaluate(SCENARIO, "power", flying, FEW)
    level = found.flights.groupby("scheme")["power_level"]
    assert level.count().to_dict() == {"optimum_power": 2 * SCENARIO.num_slots, "re_lt": 0}
    own = level.get_group("optimum_power").to_numpy()[: SCENARIO.num_slots]
    np.testing.assert_allclose(own, np.linspace(0.0, -60.0, SCENARIO.num_slots), atol=1e-3)
    silent = evaluate(controlled, "power", {"no_helper": no_helper(controlled)}, FEW)
    assert "power_level" not in silent.flights


def test_fractions_of_upper_bounds_are_of_each_mode_rules_own() -> None:
    path = torch.tensor(SCENARIO.helper_starts).expand(SCENARIO.num_slots + 1, 1, 2)
    policies = {
        "re_optimum": FlightPolicy(path, SCENARIO, upper_bound=12.5),
        "re_lt": re_lt(SCENARIO),
        "ja_lt": ja_lt(SCENARIO),
    }
    found = evaluate(SCENARIO, "", policies, FEW).summary["schemes"]
    mean = found["re_lt"]["secrecy_sum_rate"]["mean"]
    assert found["re_optimum"]["upper_bound"] == found["re_lt"]["upper_bound"] == 12.5
    assert found["re_lt"]["fraction_of_upper_bound"] == pytest.approx(mean / 12.5)
    assert "upper_bound" not in found["ja_lt"]


@pytest.mark.slow
def test_the_upper_bound_of_several_helpers_stands_beside_their_optimum() -> None:
    two = dataclasses.replace(
        SCENARIO, num_slots=2, helper_starts=((60.0, 60.0), (-60.0, -60.0)), fading=False
    )
    found = evaluate(two, "two", references(two, 50.0, Console(quiet=True)), FEW)
    schemes = found.summary["schemes"]
    for name in OPTIMA.values():
        own = schemes[name]
        assert own["upper_bound"] >= own["secrecy_sum_rate"]["mean"] - 1e-4
    assert not {name for name, own in schemes.items() if "upper_bound" in own} - {*OPTIMA.values()}
