import pytest

from hyuav import InputError, Scenario
from hyuav.experiments.regimes.plan import Axes, Axis

POWER, DISTANCE = Axis(), Axis("eavesdropper_distance", 0.0, 140.0, 3, "linear")


def test_an_axis_is_spaced_evenly_or_by_equal_factors() -> None:
    assert Axis("jamming_power", 1e-4, 1.0, 3).values == pytest.approx([1e-4, 1e-2, 1.0])
    assert Axis("jamming_power", 0.0, 1.0, 3, "linear").values == [0.0, 0.5, 1.0]
    assert Axis("num_slots", 2.0, 9.0, 3, "linear").values == [2.0, 6.0, 9.0]


def test_a_map_has_a_line_for_each_y_and_a_point_for_each_x() -> None:
    scenario = Scenario.preset("two_clusters")
    lines = Axes(Axis("num_slots", 1.0, 2.0, 2), DISTANCE).lines(scenario)
    assert [[(p.x, p.y) for p in line] for line in lines] == [
        [(1.0, y), (2.0, y)] for y in (0.0, 70.0, 140.0)
    ]
    last = lines[-1][-1].scenario
    assert last.num_slots == 2
    assert last.eavesdropper_positions[0] == pytest.approx((98.99, 98.99), abs=0.01)


@pytest.mark.parametrize(
    ("fields", "line"),
    [
        (("jaming_power",), "(did you mean 'jamming_power'?)"),
        (("fading", 0.0, 1.0), "field = 'fading': expected one of num_slots, "),
        (("ue_positions", 0.0, 1.0), "field = 'ue_positions': expected one of num_slots, "),
        (("ue_power", 0.2), "high = 0.1: expected a number > low = 0.2"),
        (("ue_power", 0.1), "high = 0.1: expected a number > low = 0.1"),
        (("ue_power", 0.0), "low = 0.0: expected a number > 0, or scale=linear"),
        (("ue_power", -1.0), "low = -1.0: expected a number > 0, or scale=linear"),
        (("num_slots", 1.0, 4.0, 5, "linear"), "points = 5: expected at most 4, the whole numbers"),
        (("ue_power", 1e-6, 0.1, 1), "points = 1: expected a whole number >= 2"),
        (("ue_power", 1e-6, 0.1, 5, "cubic"), "scale = 'cubic': expected one of linear, log"),
        (("ue_power", "loud"), "low = 'loud': expected a finite number"),
    ],
)
def test_an_axis_that_cannot_be_swept_is_refused(fields: tuple[object, ...], line: str) -> None:
    with pytest.raises(InputError) as refused:
        Axis(*fields)  # type: ignore[arg-type]
    assert line in str(refused.value)


def test_both_axes_are_not_the_same() -> None:
    with pytest.raises(InputError, match="field = 'jamming_power': expected another field than x"):
        Axes(POWER, Axis("jamming_power", 1.0, 2.0))


@pytest.mark.parametrize(
    ("axis", "line"),
    [
        (
            Axis("eavesdropper_distance", 1.0, 200.0),
            r"y\.high = 200\.0: expected a value that the scenario takes \(eavesdropper_positions",
        ),
        (
            Axis("ground_to_air_exponent", -1.0, 2.0, 3, "linear"),
            r"y\.low = -1\.0: expected a value that the scenario takes \(ground_to_air_exponent",
        ),
    ],
)
def test_values_that_no_scenario_takes_are_refused(axis: Axis, line: str) -> None:
    with pytest.raises(InputError, match=line):
        Axes(POWER, axis).lines(Scenario.preset("two_clusters"))


def test_two_values_that_a_scenario_does_not_take_together_are_refused() -> None:
    axes = Axes(Axis("map_side", 170.0, 400.0, 2), DISTANCE)
    with pytest.raises(InputError, match=r"map_side = 170\.0: expected a value that the scenario"):
        axes.lines(Scenario.preset("two_clusters"))
