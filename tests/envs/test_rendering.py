from typing import Any

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle

from hyuav import InputError, Scenario
from hyuav.envs import rendering

SCENARIO = Scenario.preset("two_clusters")
PATH = [(-60.0, -60.0), (-50.0, -40.0), (-49.0, 6.0), (0.0, 40.0), (80.0, 80.0)]
MODES = [1, 1, 0, 0]


@pytest.fixture
def axes() -> Axes:
    return Figure().add_subplot()


def lines_of_style(axes: Axes, style: str) -> list[Line2D]:
    return [line for line in axes.lines if line.get_linestyle() == style]


def test_relay_slots_are_one_solid_line_and_jamming_slots_one_dashed_line(axes: Axes) -> None:
    rendering.draw_flight(axes, PATH, MODES, "black")
    (solid,), (dashed,) = lines_of_style(axes, "-"), lines_of_style(axes, "--")
    np.testing.assert_array_equal(solid.get_xydata(), PATH[:3])
    np.testing.assert_array_equal(dashed.get_xydata(), PATH[2:])


def test_every_slot_has_a_dot_full_for_relay_and_hollow_for_jamming(axes: Axes) -> None:
    rendering.draw_flight(axes, PATH, MODES, "black")
    full, hollow = [line for line in axes.lines if line.get_marker() == "o"]
    np.testing.assert_array_equal(full.get_xydata(), PATH[1:3])
    np.testing.assert_array_equal(hollow.get_xydata(), PATH[3:])
    assert to_hex(hollow.get_markerfacecolor()) == "#ffffff"


def test_start_and_end_of_a_flight_are_marked(axes: Axes) -> None:
    rendering.draw_flight(axes, PATH, MODES, "black")
    (start,) = [line for line in axes.lines if line.get_marker() == "D"]
    (end,) = [line for line in axes.lines if line.get_marker() == "*"]
    np.testing.assert_array_equal(start.get_xydata(), PATH[:1])
    np.testing.assert_array_equal(end.get_xydata(), PATH[-1:])


def test_a_flight_has_one_legend_entry_whatever_its_modes(axes: Axes) -> None:
    rendering.draw_flight(axes, PATH, MODES, "black", label="hybrid")
    assert axes.get_legend_handles_labels()[1] == ["hybrid"]


def test_a_flight_that_has_not_begun_is_only_its_start(axes: Axes) -> None:
    rendering.draw_flight(axes, PATH[:1], [], "black")
    assert [line.get_marker() for line in axes.lines] == ["D"]


@pytest.mark.parametrize(
    ("positions", "modes"), [(PATH, MODES[:-1]), (PATH[0], []), ([], []), (PATH, [MODES])]
)
def test_a_flight_of_mismatched_shapes_is_refused_in_one_line(
    axes: Axes, positions: Any, modes: Any
) -> None:
    with pytest.raises(InputError, match="expected shape") as refusal:
        rendering.draw_flight(axes, positions, modes, "black")
    assert "\n" not in str(refusal.value)


def test_the_map_is_in_metres_of_equal_scale_and_ends_at_the_map_s_edge(axes: Axes) -> None:
    rendering.draw_scenario(axes, SCENARIO)
    assert axes.get_xlim() == axes.get_ylim() == (-100.0, 100.0)
    assert axes.get_aspect() == 1.0
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("x (m)", "y (m)")


def test_the_map_shows_every_node_and_the_coverage_of_the_legitimate_uav(axes: Axes) -> None:
    rendering.draw_scenario(axes, SCENARIO)
    drawn = {line.get_label(): line.get_xydata() for line in axes.lines}
    np.testing.assert_array_equal(drawn["UE"], SCENARIO.ue_positions)
    np.testing.assert_array_equal(drawn["legitimate UAV (L)"], [SCENARIO.legitimate_position])
    np.testing.assert_array_equal(drawn["eavesdropper (E)"], [SCENARIO.eavesdropper_positions[0]])
    (disk,) = [patch for patch in axes.patches if isinstance(patch, Circle)]
    assert disk.get_radius() == SCENARIO.coverage_radius


def test_covered_ues_are_told_from_the_others(axes: Axes) -> None:
    covered = np.arange(SCENARIO.num_ues) < 7
    rendering.draw_scenario(axes, SCENARIO, covered)
    drawn = {line.get_label(): line.get_xydata() for line in axes.lines}
    np.testing.assert_array_equal(drawn["UE, covered"], SCENARIO.ue_positions[:7])
    np.testing.assert_array_equal(drawn["UE, not covered"], SCENARIO.ue_positions[7:])
    with pytest.raises(InputError, match="covered"):
        rendering.draw_scenario(axes, SCENARIO, covered[:3])


def test_no_label_is_cut_off_at_the_frame_s_edge() -> None:
    frame = rendering.render_frame(SCENARIO, PATH, [1, *MODES])
    edges = (frame[0], frame[-1], frame[:, 0], frame[:, -1])
    assert all((edge == 255).all() for edge in edges)


def test_frames_are_of_one_even_size_as_video_encoders_want() -> None:
    first = rendering.render_frame(SCENARIO, PATH[:1], [1])
    last = rendering.render_frame(SCENARIO, PATH, [1, *MODES])
    assert first.shape == last.shape
    assert first.shape[0] % 2 == first.shape[1] % 2 == 0


def test_a_map_of_kilometres_has_its_labels_within_the_frame() -> None:
    wide = Scenario(ue_positions=((0.0, 0.0),), map_side=24000.0)
    frame = rendering.render_frame(wide, PATH[:1], [0])
    assert (frame[:, 0] == 255).all()


def test_the_legend_s_samples_are_solid_for_relay_and_dashed_for_jamming() -> None:
    handles = rendering.mode_handles()
    assert [handle.get_linestyle() for handle in handles] == ["-", "--"]
    assert [handle.get_label() for handle in handles] == ["helper relays", "helper jams"]
