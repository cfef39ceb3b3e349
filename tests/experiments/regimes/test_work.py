import dataclasses
from typing import Any

import pytest
import torch

from hyuav import Scenario, solve_optimum
from hyuav.experiments.regimes.plan import Regimes
from hyuav.experiments.regimes.work import solve_point
from hyuav.physics.slot import Physics
from hyuav.references.rewards import estimate_return

OPTIONS = Regimes(resolution=20.0, power_step=10.0, draws=4, evaluation_draws=8, workers=1)


def short(**changes: Any) -> Scenario:
    return dataclasses.replace(Scenario.preset("two_clusters"), num_slots=4, **changes)


@pytest.mark.parametrize("fading", [False, True])
def test_a_point_has_the_values_of_the_optima(fading: bool) -> None:
    scenario = short(fading=fading, jamming_power=1e-3)
    found = solve_point(scenario, OPTIONS)
    exactly: Any = {"resolution": 20.0, "power_step": 10.0, "draws": 4, "evaluation_draws": 8}
    optima = solve_optimum(scenario, **exactly)
    for rule, optimum in optima.items():
        assert found[rule] == optimum.value
    controlled = dataclasses.replace(scenario, power_control=True)
    best = solve_optimum(controlled, ["hybrid"], **exactly)["hybrid"]
    assert found["power_control"] == best.value
    assert solve_point(controlled, OPTIONS) == found


@pytest.mark.parametrize(
    ("preset", "expected"), [("random_disk", 370.41), ("two_clusters", 388.58)]
)
def test_without_a_helper_ues_send_straight(preset: str, expected: float) -> None:
    scenario = dataclasses.replace(Scenario.preset(preset), fading=False)
    options = dataclasses.replace(OPTIONS, resolution=50.0, power_step=60.0)
    assert solve_point(scenario, options)["no_helper"] == pytest.approx(expected, abs=0.005)


def test_no_helper_is_one_that_jams_without_power_and_stays() -> None:
    scenario = short()
    physics = Physics(scenario, dtype=torch.float64)
    path = physics.nodes.helper.expand(5, 1, 2)
    value, error, _ = estimate_return(
        physics, path, "jamming", 4000, torch.Generator().manual_seed(0), torch.zeros(4, 1)
    )
    many = dataclasses.replace(OPTIONS, evaluation_draws=4000)
    assert solve_point(scenario, many)["no_helper"] == pytest.approx(value, abs=6 * error)


def test_what_earns_nothing_anywhere_is_no_cause_for_a_warning(
    recwarn: pytest.WarningsRecorder,
) -> None:
    found = solve_point(short(coverage_radius=1.2345), OPTIONS)
    assert set(found.values()) == {0.0}
    assert not recwarn.list
