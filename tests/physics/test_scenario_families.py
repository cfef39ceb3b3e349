"""The families' ranges, and that splits and seeds are apart."""

import math

import pytest

from hyuav import InputError, family
from hyuav.physics.scenario_families import FAMILIES, SPLITS, Ruled

COUNT = 150


@pytest.fixture(scope="module", params=FAMILIES)
def drawn(request: pytest.FixtureRequest) -> tuple[str, list[Ruled]]:
    return request.param, [family(request.param, seed) for seed in range(COUNT)]


def test_all_that_is_drawn_is_in_its_range(drawn: tuple[str, list[Ruled]]) -> None:
    name, several = drawn
    spread = 35.0 if name == "one" else 100.0
    helpers, eavesdroppers = {"one": (1, 1), "two": (2, 2), "many": (4, 3)}[name]
    for scenario, mode_rule in several:
        x, y = scenario.legitimate_position
        assert max(abs(x), abs(y)) <= 30.0
        farthest = max(math.dist(ue, (x, y)) for ue in scenario.ue_positions)
        assert farthest <= max(45.0, spread + 20.0) + 1e-9
        assert 4 <= scenario.num_ues <= 20
        assert 8 <= scenario.num_slots <= 30
        assert mode_rule in ("hybrid", "relay", "jamming")
        assert scenario.num_helpers <= helpers
        assert scenario.num_eavesdroppers <= eavesdroppers
        if name == "one":
            assert (scenario.jamming_power, scenario.coverage_radius) == (0.08, 45.0)
        else:
            assert scenario.num_helpers >= min(helpers, 3)
            assert 1e-5 <= scenario.jamming_power <= 0.08
            assert 45.0 <= scenario.coverage_radius <= 120.0
            assert 80.0 <= scenario.eavesdropper_altitude <= 120.0


def test_all_of_each_range_is_drawn(drawn: tuple[str, list[Ruled]]) -> None:
    name, several = drawn
    scenarios = [own.scenario for own in several]
    assert {own.mode_rule for own in several} == {"hybrid", "relay", "jamming"}
    assert {own.power_control for own in scenarios} == {False, True}
    assert {own.num_ues for own in scenarios} == set(range(4, 21))
    assert {own.num_slots for own in scenarios} == set(range(8, 31))
    if name != "one":
        assert {own.eavesdroppers for own in scenarios} == {"independent", "colluding"}
    if name == "many":
        assert {own.num_helpers for own in scenarios} == {3, 4}
        assert {own.num_eavesdroppers for own in scenarios} == {2, 3}


@pytest.mark.parametrize("name", FAMILIES)
def test_a_seed_draws_the_same_in_its_split_and_another_one_in_each_other(name: str) -> None:
    assert family(name, 3) == family(name, 3, "test")
    several = {family(name, seed, split).scenario for seed in range(3) for split in SPLITS}
    assert len(several) == 9


def test_budgets_never_bind() -> None:
    for seed in range(20):
        for name in FAMILIES:
            scenario, mode_rule = family(name, seed)
            from hyuav.physics.energy import edge_can_saturate, ue_can_pay
            from hyuav.physics.motion import norm_limits

            assert not edge_can_saturate(scenario)
            assert ue_can_pay(scenario, relay=False)
            assert norm_limits(scenario, [mode_rule]) is None


def test_what_is_unknown_is_refused_in_one_line() -> None:
    with pytest.raises(InputError, match=r"^family = 'three': expected one of one, two, many$"):
        family("three", 0)
    with pytest.raises(InputError, match=r"^split = 'tests': "):
        family("one", 0, "tests")
    with pytest.raises(InputError, match=r"^seed = -1: "):
        family("one", -1)
