"""A scenario in which a mode can never earn anything says so, once."""

import dataclasses
import subprocess
import sys
import warnings
from collections.abc import Callable
from typing import Any

import pytest
import torch

from hyuav import (
    DDPG,
    EvaluationParameters,
    FlightPolicy,
    Learner,
    Scenario,
    ScenarioWarning,
    Training,
    TrainingParameters,
    disk,
    evaluate,
    make_env,
    solve_optimum,
)
from hyuav.physics import prospects
from hyuav.physics.energy import edge_energy, ue_can_pay
from hyuav.physics.slot import Physics

PRESET = Scenario.preset("two_clusters")
ONE_UE = Scenario(ue_positions=((0.0, 10.0),), num_slots=4)


@pytest.fixture(autouse=True)
def nothing_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(prospects, "_told", set())


def told(make: Callable[[], Any]) -> list[str]:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        make()
    return [str(own.message) for own in caught if own.category is ScenarioWarning]


@pytest.mark.parametrize("num_ues", [1, 2, 3, 4, 10])
@pytest.mark.parametrize("budget", [0.0, 0.002, 0.025, 0.06, 0.1])
def test_modes_that_no_ue_can_pay_for_are_named(num_ues: int, budget: float) -> None:
    positions = disk(num_ues, seed=1)
    scenario = Scenario(ue_positions=positions, ue_energy_budget=budget)
    lines = told(lambda: Physics(scenario))
    modes = {"relaying": ue_can_pay(scenario, relay=True), "jamming": False}
    modes["jamming"] = ue_can_pay(scenario, relay=False)
    assert len(lines) == (not all(modes.values()))
    named = lines[0].partition("can earn nothing")[0] if lines else ""
    assert {mode for mode in modes if mode in named} == {m for m, pays in modes.items() if not pays}


def test_the_line_names_field_value_and_what_would_be_needed() -> None:
    (line,) = told(lambda: Physics(ONE_UE))
    assert line == (
        "ue_energy_budget = 0.025 J: with 1 UE, relaying and jamming can earn nothing, since "
        "sending through such a slot takes a UE 0.05 J and 0.1 J; that much, or 2 and 4 UEs to "
        "share a slot, would do"
    )
    (line,) = told(lambda: Physics(dataclasses.replace(ONE_UE, ue_energy_budget=0.05)))
    assert "with 1 UE, jamming can earn nothing" in line
    assert not told(lambda: Physics(dataclasses.replace(ONE_UE, ue_energy_budget=0.1)))
    assert not told(lambda: Physics(Scenario(ue_positions=disk(4, seed=0))))


@pytest.mark.parametrize("kept", [True, False])
def test_what_is_said_to_earn_nothing_earns_nothing_and_what_would_do_does(*, kept: bool) -> None:
    needed = 0.1 if kept else 0.0999
    elsewhere = ((20.0, 60.0),)
    near = dataclasses.replace(ONE_UE, ue_energy_budget=needed, eavesdropper_positions=elsewhere)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        env = make_env(near, "jamming", batch_size=(64,), seed=0)
    start = env.reset().set("position", torch.tensor(elsewhere).expand(64, 1, 2))
    start["action"] = torch.zeros(64, 2)
    assert bool((env.step(start)["next", "reward"] > 0).any()) == kept


def test_an_edge_that_cannot_compute_the_smallest_task_is_named() -> None:
    smallest = edge_energy(PRESET, PRESET.task_size[0] * PRESET.cycles_per_bit[0])
    scenario = dataclasses.replace(PRESET, edge_energy_budget=smallest * 0.99)
    (line,) = told(lambda: Physics(scenario))
    assert line.startswith("edge_energy_budget = 0.00405504 J: nothing can be earned, since")
    assert f"{smallest:g} J" in line
    assert not told(lambda: Physics(dataclasses.replace(PRESET, edge_energy_budget=smallest)))


def test_a_layout_of_which_l_covers_no_ue_is_named() -> None:
    far = Scenario(ue_positions=((50.0, 0.0), (0.0, 60.0), (0.0, 70.0), (0.0, 80.0)))
    (line,) = told(lambda: make_env(far))
    assert line == (
        "coverage_radius = 45 m: nothing can be earned, since L covers no UE; "
        "it is 50 m away from the nearest"
    )
    near = Scenario(ue_positions=disk(4, seed=0))
    (line,) = told(lambda: make_env([near, far, near], batch_size=3))
    assert "nothing can be earned in 1 of 3 layouts, since" in line
    assert not told(lambda: make_env(dataclasses.replace(far, coverage_radius=50.0)))


def test_the_papers_scenarios_earn_in_both_modes() -> None:
    assert not told(lambda: [make_env(name) for name in ("two_clusters", "random_disk")])


def train() -> Training:
    learners = [Learner(seed=seed, num_slots=slots) for seed in (0, 1) for slots in (3, 4)]
    return Training(ONE_UE, learners, DDPG(hidden_sizes=(8,)), TrainingParameters(num_episodes=1))


def fly() -> Any:
    policies = {"optimum": [FlightPolicy(torch.zeros(5, 1, 2), ONE_UE)]}
    return evaluate(ONE_UE, "one", policies, EvaluationParameters(episodes=2, flights=1))


@pytest.mark.parametrize(
    "call",
    [
        lambda: make_env(ONE_UE, batch_size=3),
        lambda: solve_optimum(ONE_UE, resolution=50.0, draws=2, evaluation_draws=2),
        train,
        fly,
    ],
    ids=["make_env", "solve_optimum", "Training", "evaluate"],
)
def test_it_is_told_once_however_the_scenario_is_flown(call: Callable[[], Any]) -> None:
    assert len(told(call)) == 1
    assert not told(call)


def test_a_command_shows_it_as_one_line_on_standard_error() -> None:
    program = (
        "from hyuav import Scenario, make_env;"
        "one = Scenario(ue_positions=((0.0, 10.0),));"
        "import hyuav._support.start;"
        "make_env(one); make_env(one, batch_size=2)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.returncode == 0
    (line,) = (own for own in done.stderr.splitlines() if "can earn nothing" in own)
    assert line.startswith("warning: ue_energy_budget = 0.025 J: with 1 UE, ")
    assert "prospects.py" not in done.stderr
