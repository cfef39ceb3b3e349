import numpy as np
import pandas as pd
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from hyuav import Scenario
from hyuav.experiments.evaluation import Evaluation
from hyuav.viz.data.schemes import COLORS
from hyuav.viz.paper.flights import FLIGHT_PANELS, flight_map, trajectories


def texts(figure: Figure) -> list[str]:
    return [text.get_text() for legend in figure.legends for text in legend.get_texts()]


def test_the_flight_map_shows_every_scheme_that_was_flown(
    scenario: Scenario, evaluation: Evaluation
) -> None:
    figure = flight_map(scenario, evaluation.flights)
    assert len(figure.axes) == len(FLIGHT_PANELS) - 1  # nobody has learned the helper's power
    learned = evaluation.flights[evaluation.flights["scheme"] == "proposed"]
    with_power = pd.concat([evaluation.flights, learned.assign(scheme="proposed_power")])
    assert len(flight_map(scenario, with_power).axes) == len(FLIGHT_PANELS)
    assert {"Re-LT", "Ja-LT", "UE", "helper relays", "helper jams"} <= set(texts(figure))
    assert {"coverage of L", "start", "end"} <= set(texts(figure))
    assert "Re-OT" not in texts(figure)


def test_trajectories_lie_over_the_optimums_flight(
    scenario: Scenario, evaluation: Evaluation
) -> None:
    figure = trajectories(scenario, evaluation.flights)
    (axes,) = figure.axes
    best = max(axes.lines, key=lambda line: line.get_linewidth())
    path = np.asarray(best.get_xydata())
    assert path[0].tolist() == list(scenario.helper_starts[0])
    assert len(path) == scenario.num_slots + 1
    own = [line for line in axes.lines if to_hex(line.get_color()) == COLORS["proposed"].lower()]
    dots = np.concatenate([line.get_xydata() for line in own if line.get_marker() == "o"])
    assert {tuple(dot) for dot in dots} == {tuple(place) for place in path[1:]}
    assert [line.get_marker() for line in own if line.get_marker() in ("D", "*")] == ["D", "*"]
    assert {"Proposed", "Optimum", "start", "end", "coverage of L"} <= set(texts(figure))
    assert not {"Re-OT", "Ja-OT", "Re-LT"} & set(texts(figure))


def test_each_of_several_helpers_has_its_line_and_its_number(
    relaying_and_jamming: tuple[Scenario, Evaluation],
) -> None:
    scenario, evaluation = relaying_and_jamming
    (axes,) = trajectories(scenario, evaluation.flights).axes
    assert [text.get_text() for text in axes.texts] == ["1", "2"]
    ends = [line.get_xydata() for line in axes.lines if line.get_marker() == "*"]
    assert [tuple(own) for (own,) in map(np.asarray, ends)] == list(scenario.helper_starts)
    assert texts(axes.figure).count("Proposed") == texts(axes.figure).count("Optimum") == 1  # type: ignore[arg-type]
