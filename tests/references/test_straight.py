import dataclasses

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

import reference
import worlds
from hyuav import InputError, Scenario, make_env
from hyuav.experiments.schemes import NO_HELPER, SCHEMES
from hyuav.references.straight import ja_lt, no_helper, re_lt, relay_destination

PRESETS = [Scenario.preset("random_disk"), Scenario.preset("two_clusters")]


@pytest.mark.parametrize("scenario", PRESETS)
@pytest.mark.parametrize("num_slots", [10, 20])
def test_re_lt_reaches_midway_between_l_and_the_ues_in_the_last_slot(
    scenario: Scenario, num_slots: int
) -> None:
    scenario = dataclasses.replace(scenario, num_slots=num_slots, legitimate_position=(4.0, -8.0))
    flown = make_env(scenario, "relay").rollout(num_slots, re_lt(scenario))
    centroid = torch.tensor(scenario.ue_positions).mean(dim=0)
    expected = (centroid + torch.tensor((4.0, -8.0))) / 2
    torch.testing.assert_close(flown["next", "position"][-1, 0], expected, atol=1e-3, rtol=0)


@pytest.mark.parametrize("scenario", PRESETS)
def test_ja_lt_reaches_the_eavesdropper_in_the_last_slot(scenario: Scenario) -> None:
    flown = make_env(scenario, "jamming").rollout(20, ja_lt(scenario))
    expected = torch.tensor(scenario.eavesdropper_positions[0])
    torch.testing.assert_close(flown["next", "position"][-1, 0], expected, atol=1e-3, rtol=0)


def test_the_flight_is_straight_and_of_constant_speed() -> None:
    scenario = PRESETS[1]
    position = make_env(scenario, "jamming", (3,)).rollout(20, ja_lt(scenario))["next", "position"]
    steps = position.diff(dim=1)
    torch.testing.assert_close(steps, steps[:1, :1].expand_as(steps), atol=1e-4, rtol=0)


def test_the_destination_of_re_lt_by_hand() -> None:
    scenario = Scenario(ue_positions=((10, 0), (30, 20)), legitimate_position=(-4, 2))
    assert relay_destination(scenario) == (8.0, 6.0)


@pytest.mark.parametrize(("num_slots", "speed_limit"), [(6, "box"), (9, "disc")])
def test_a_flight_faster_than_v_max_says_so(num_slots: int, speed_limit: str) -> None:
    scenario = dataclasses.replace(PRESETS[0], num_slots=num_slots, speed_limit=speed_limit)
    with pytest.raises(InputError, match=rf"^num_slots = {num_slots}: [^\n]*max_speed[^\n]*$"):
        ja_lt(scenario)
    ja_lt(dataclasses.replace(scenario, num_slots=num_slots + 1))


def test_a_flight_beyond_the_helpers_energy_says_so() -> None:
    scenario = dataclasses.replace(PRESETS[0], helper_energy_budget=100.0)
    with pytest.raises(InputError, match="helper_energy_budget allows"):
        ja_lt(scenario)


@settings(max_examples=15)
@given(worlds.scenarios(several=True), st.booleans(), st.integers(0, 2**31))
def test_without_a_helper_everybody_may_send_straight_for_the_whole_share(
    scenario: Scenario, power_control: bool, seed: int
) -> None:
    scenario = dataclasses.replace(scenario, power_control=power_control)
    own = SCHEMES[NO_HELPER]
    env = make_env(own.flown_in(scenario), own.mode_rule, 3, seed=seed, diagnostics=True)
    state = no_helper(scenario)(env.reset())
    powers, cycles = reference.next_draws(env)
    flown = env.step(state)["next"]
    starts = scenario.helper_starts
    torch.testing.assert_close(flown["position"], torch.tensor(starts).expand(3, -1, -1))
    assert not flown["diagnostics", "helper_energy"].any()
    for row in range(3):
        expected, margin = reference.no_helper(scenario, starts, powers[row], cycles[row])
        if margin > 1e-4:
            assert flown["reward"][row].item() == pytest.approx(expected, rel=1e-4, abs=1e-4)
