import itertools
from typing import Any

import numpy as np
import pandas as pd
import pytest

from hyuav import InputError, Scenario
from hyuav.experiments.evaluation import Evaluation
from hyuav.experiments.run_directory import RunDirectory
from hyuav.viz.data.reading import readable_flights
from hyuav.viz.html.player import flight_player
from hyuav.viz.html.player_map import LINKS

pytest_plugins = "sample_runs"


@pytest.fixture(scope="module")
def scenario(evaluated: RunDirectory) -> Scenario:
    return evaluated.configuration().scenario


@pytest.fixture(scope="module")
def flights(evaluated: RunDirectory) -> pd.DataFrame:
    rows = readable_flights(evaluated.path)
    assert rows is not None
    return rows


@pytest.fixture(scope="module")
def slots(flights: pd.DataFrame) -> pd.DataFrame:
    """The best flight, which both relays and jams."""
    rows = flights[(flights["scheme"] == "optimum") & (flights["episode"] == 0)]
    assert rows["relay"].nunique() == 2
    return rows.reset_index(drop=True)


@pytest.fixture(scope="module")
def frames(scenario: Scenario, flights: pd.DataFrame) -> list[dict[str, Any]]:
    """What is drawn in each slot, by its name."""
    player = flight_player(scenario, flights, "optimum")
    return [{trace.name: trace for trace in frame.data} for frame in player.frames]


def _points(trace: Any) -> set[tuple[float, float]]:
    return {(x, y) for x, y in zip(trace.x, trace.y, strict=True) if x is not None}


def _segments(trace: Any) -> int:
    """Of a line that breaks at None."""
    gaps = [x is None for x in trace.x]
    return sum(not one and not other for one, other in itertools.pairwise(gaps))


def test_there_is_a_step_of_the_slider_for_each_slot(
    scenario: Scenario, flights: pd.DataFrame
) -> None:
    player = flight_player(scenario, flights, "proposed", 1)
    names = [str(slot + 1) for slot in range(scenario.num_slots)]
    assert [frame.name for frame in player.frames] == names
    (slider,) = player.layout.sliders
    assert [step.args[0][0] for step in slider.steps] == names


def test_exactly_the_ues_that_offload_are_filled(
    scenario: Scenario, slots: pd.DataFrame, frames: list[dict[str, Any]]
) -> None:
    ues = np.array(scenario.ue_positions)
    for frame, chosen in zip(frames, slots["offloading"], strict=True):
        filled, hollow = frame["UE, offloads"], frame["UE, computes itself"]
        assert _points(filled) == {tuple(ue) for ue in ues[np.array(chosen)]}
        assert _points(hollow) == {tuple(ue) for ue in ues[~np.array(chosen)]}
        assert (filled.marker.color, hollow.marker.color) == ("#000000", "#FFFFFF")


def test_the_links_are_those_of_the_slots_mode(
    slots: pd.DataFrame, frames: list[dict[str, Any]]
) -> None:
    for frame, (_, slot) in zip(frames, slots.iterrows(), strict=True):
        senders = sum(slot["offloading"])
        alive = {name: _segments(frame[name]) for name in LINKS}
        assert alive == {
            "UE → L": senders,
            "UE → H": senders if slot["relay"] else 0,
            "H → L, relays": int(slot["relay"] and senders > 0),
            "H → E, jams": int(not slot["relay"]),
        }


def test_the_helpers_coverage_counts_in_relay_slots_alone(
    scenario: Scenario, slots: pd.DataFrame, frames: list[dict[str, Any]]
) -> None:
    for frame, (_, slot) in zip(frames, slots.iterrows(), strict=True):
        disk = frame["coverage of H, relaying"]
        assert bool(_points(disk)) == slot["relay"]
        if slot["relay"]:
            away = np.hypot(np.array(disk.x) - slot["x"], np.array(disk.y) - slot["y"])
            np.testing.assert_allclose(away, scenario.coverage_radius, atol=0.2)


def test_the_path_up_to_a_slot_is_solid_where_it_relayed_and_dashed_where_it_jammed(
    scenario: Scenario, slots: pd.DataFrame, frames: list[dict[str, Any]]
) -> None:
    for index, frame in enumerate(frames):
        flown = slots["relay"][: index + 1]
        relayed, jammed = frame["flown relaying"], frame["flown jamming"]
        assert (_segments(relayed), _segments(jammed)) == (flown.sum(), (~flown).sum())
        assert relayed.line.dash == "solid"
        assert jammed.line.dash not in ("solid", None)
        first = tuple(scenario.helper_starts[0])
        assert first in _points(relayed) | _points(jammed)


def test_rates_and_energies_are_those_of_the_slot(
    scenario: Scenario, slots: pd.DataFrame, frames: list[dict[str, Any]]
) -> None:
    for frame, (_, slot) in zip(frames, slots.iterrows(), strict=True):
        np.testing.assert_allclose(frame["secrecy rate"].y, slot["secrecy_rate"], atol=1e-4)
        spent = [*slot["ue_energy"], slot["edge_energy"], slot["helper_energy"]]
        budgets = [scenario.ue_energy_budget] * scenario.num_ues
        budgets += [scenario.edge_energy_budget, scenario.helper_energy_budget]
        np.testing.assert_allclose(
            frame["energy"].y, 100 * np.array(spent) / budgets, atol=0.01, rtol=1e-3
        )


def test_the_map_is_square_and_ends_where_the_scenarios_map_ends(
    scenario: Scenario, flights: pd.DataFrame
) -> None:
    layout = flight_player(scenario, flights, "proposed").layout
    half = scenario.map_side / 2
    assert list(layout.xaxis.range) == list(layout.yaxis.range) == [-half, half]
    assert layout.yaxis.scaleanchor == "x"


def test_a_flight_that_is_not_there_is_refused(scenario: Scenario, flights: pd.DataFrame) -> None:
    with pytest.raises(InputError, match=r"flight = 'proposed 7': expected a scheme and episode"):
        flight_player(scenario, flights, "proposed", 7)


def test_flights_over_other_ues_are_refused(flights: pd.DataFrame) -> None:
    alone = Scenario(ue_positions=((0.0, 0.0),))
    with pytest.raises(InputError, match=r"each of the scenario's 1 UEs"):
        flight_player(alone, flights, "proposed")


def test_the_player_moves_all_helpers_in_their_modes(
    relaying_and_jamming: tuple[Scenario, Evaluation],
) -> None:
    scenario, evaluation = relaying_and_jamming
    player = flight_player(scenario, evaluation.flights, "proposed")
    assert "slot 1 of 3: H 1 jams, H 2 relays<" in player.layout.title.text
    for frame in player.frames:
        drawn = {trace.name: trace for trace in frame.data}
        assert _points(drawn["helper UAV (H)"]) == set(scenario.helper_starts)
        assert drawn["helper UAV (H)"].text == ("H 1", "H 2")
        assert drawn["eavesdropper (E)"].text == ("E 1", "E 2")
        assert _segments(drawn["UE → H"]) == 4
        assert [_segments(drawn[name]) for name in ("H → L, relays", "H → E, jams")] == [1, 1]
        (x, y) = (np.mean(drawn["coverage of H, relaying"][axis]) for axis in "xy")
        assert (x, y) == pytest.approx(scenario.helper_starts[1], abs=2.0)


def test_the_power_of_each_of_several_helpers_is_told(
    relaying_and_jamming: tuple[Scenario, Evaluation], with_power: pd.DataFrame
) -> None:
    scenario, _ = relaying_and_jamming
    player = flight_player(scenario, with_power, "proposed")
    told = "slot 2 of 3: H 1 jams at -20.0 dB, H 2 relays at -2.0 dB<"
    assert told in player.frames[1].layout.title.text
    powers = {trace.name: trace for trace in player.data if "power" in (trace.name or "")}
    assert {name: trace.y for name, trace in powers.items()} == {
        "power of H 1": (-10.0, -20.0, -30.0),
        "power of H 2": (-1.0, -2.0, -3.0),
    }
    assert len({trace.line.dash for trace in powers.values()}) == 2


def test_the_power_of_each_slot_is_told_where_it_is_chosen(
    scenario: Scenario, flights: pd.DataFrame
) -> None:
    player = flight_player(scenario, flights, "optimum_power")
    rows = flights[(flights["scheme"] == "optimum_power") & (flights["episode"] == 0)]
    levels = rows.sort_values("slot")["power_level"].to_numpy()
    (power,) = [trace for trace in player.data if trace.name == "power of H"]
    np.testing.assert_allclose(power.y, levels, atol=0.01)
    assert player.layout.yaxis5.overlaying == "y4"
    for frame, level in zip(player.frames, levels, strict=True):
        assert f" at {level:.1f} dB" in frame.layout.title.text
    nominal = flight_player(scenario, flights, "optimum")
    assert "power of H" not in {trace.name for trace in nominal.data}
    assert " dB" not in nominal.layout.title.text
