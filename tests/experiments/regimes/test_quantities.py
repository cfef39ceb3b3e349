import dataclasses
import math

import pytest

from hyuav import InputError, Scenario
from hyuav.experiments.regimes.quantities import QUANTITIES

SCENARIO = Scenario.preset("two_clusters")


def test_what_a_scenario_has_already_changes_nothing() -> None:
    for quantity in QUANTITIES.values():
        same = quantity.changed(SCENARIO, quantity.of(SCENARIO))
        (place,) = same.eavesdropper_positions
        assert place == pytest.approx((80.0, 80.0))
        assert dataclasses.replace(same, eavesdropper_positions=((80.0, 80.0),)) == SCENARIO


def test_all_single_numbers_of_a_scenario_can_vary_and_nothing_else() -> None:
    single = {
        field.name
        for field in dataclasses.fields(Scenario)
        if type(getattr(SCENARIO, field.name)) in (int, float)
    }
    assert set(QUANTITIES) == single | {"eavesdropper_distance", "ue_spread"}


def test_the_eavesdropper_moves_along_its_own_direction_from_l() -> None:
    shifted = dataclasses.replace(
        SCENARIO, legitimate_position=(10.0, 0.0), eavesdropper_positions=((10.0, -40.0),)
    )
    moved = QUANTITIES["eavesdropper_distance"].changed(shifted, 60.0)
    assert moved.eavesdropper_positions == ((10.0, -60.0),)
    above = dataclasses.replace(shifted, eavesdropper_positions=((10.0, 0.0),))
    with pytest.raises(InputError, match="expected a position with a direction from L"):
        QUANTITIES["eavesdropper_distance"].changed(above, 60.0)


def test_the_ues_spread_around_l() -> None:
    spread = QUANTITIES["ue_spread"].changed(SCENARIO, 0.5)
    for far, near in zip(SCENARIO.ue_positions, spread.ue_positions, strict=True):
        assert math.hypot(*near) == pytest.approx(0.5 * math.hypot(*far))
