import dataclasses

import numpy as np
import pandas as pd
import pytest

from hyuav import InputError, Scenario
from hyuav.experiments.evaluation import Evaluation
from hyuav.viz.data.flights import (
    energy_table,
    flight_tables,
    flying_schemes,
    links,
    offloading_table,
    read_flight,
    told_modes,
)


def test_the_tables_hold_the_flights_from_the_start_and_all_nodes(
    scenario: Scenario, evaluation: Evaluation
) -> None:
    tables = flight_tables(scenario, evaluation.flights, ["re_lt", "re_ot"])
    flight = tables[""]
    assert set(flight["scheme"]) == {"re_lt"}
    assert flight["slot"].tolist() == list(range(11))
    assert flight[["x", "y"]].iloc[0].to_list() == list(scenario.helper_starts[0])
    assert flight["relay"].tolist() == [None] + [True] * 10
    nodes = tables["nodes"].set_index("node")
    places = nodes[["x", "y"]].T.to_dict("list")
    assert places["UE 10"] == list(scenario.ue_positions[9])
    assert places["E"] == list(scenario.eavesdropper_positions[0])
    assert nodes["coverage"].dropna().to_dict() == {"L": scenario.coverage_radius}


def test_the_energy_of_every_node_is_told_in_every_slot(
    scenario: Scenario, evaluation: Evaluation
) -> None:
    table = energy_table(scenario, evaluation.flights)
    assert list(dict.fromkeys(table["scheme"])) == ["proposed", "re_lt", "ja_lt", "no_helper"]
    assert len(table) == 4 * 10 * 12
    own = table[table["scheme"] == "re_lt"]
    slots = read_flight(scenario, evaluation.flights, "re_lt").rows
    ues = own[own["node"].str.startswith("UE")]["energy"].to_numpy().reshape(10, 10)
    np.testing.assert_allclose(ues, np.stack(slots["ue_energy"].to_list()))
    helper = own[own["node"] == "H"]
    np.testing.assert_allclose(helper["energy"], slots["helper_energy"])
    assert set(helper["budget"]) == {scenario.helper_energy_budget}


def test_offloading_is_told_for_every_ue_and_slot(
    scenario: Scenario, evaluation: Evaluation
) -> None:
    table = offloading_table(scenario, evaluation.flights)
    assert len(table) == 5 * 10 * 10
    own = table[table["scheme"] == "ja_lt"]
    assert not own["relay"].any()
    assert (own.loc[~own["offloading"], "secrecy_rate"] == 0.0).all()
    earned = own.groupby("slot")["secrecy_rate"].sum()
    slots = read_flight(scenario, evaluation.flights, "ja_lt").rows
    np.testing.assert_allclose(earned, slots["secrecy_sum_rate"], rtol=1e-5)


def test_links_of_several_helpers_are_those_that_are_used(
    relaying_and_jamming: tuple[Scenario, Evaluation],
) -> None:
    scenario, evaluation = relaying_and_jamming
    flight = read_flight(scenario, evaluation.flights, "proposed")
    jammer, relay = scenario.helper_starts
    assert flight.path.shape == (4, 2, 2)
    assert flight.relay.tolist() == [[False, True]] * 3
    alive = links(scenario, flight, 1)
    assert [ue for ue, _ in alive.to_legitimate] == list(scenario.ue_positions)
    assert alive.to_helper == [(scenario.ue_positions[n - 1], relay) for n in (3, 4, 6, 7)]
    assert alive.relaying == [(relay, scenario.legitimate_position)]
    assert alive.jamming == [(jammer, (80.0, 80.0))]


def test_a_jammers_link_leads_to_the_nearest_eavesdropper(
    relaying_and_jamming: tuple[Scenario, Evaluation],
) -> None:
    scenario, evaluation = relaying_and_jamming
    moved = dataclasses.replace(scenario, eavesdropper_positions=((0.0, 0.0), (90.0, 40.0)))
    flight = read_flight(moved, evaluation.flights, "proposed")
    assert [end for _, end in links(moved, flight, 0).jamming] == [(90.0, 40.0)]


def test_the_tables_tell_each_of_several_helpers_and_eavesdroppers(
    relaying_and_jamming: tuple[Scenario, Evaluation],
) -> None:
    scenario, evaluation = relaying_and_jamming
    tables = flight_tables(scenario, evaluation.flights, ["proposed"])
    assert tables[""]["helper"].tolist() == [1] * 4 + [2] * 4
    assert tables[""][["x", "y"]].drop_duplicates().to_numpy().tolist() == [
        list(start) for start in scenario.helper_starts
    ]
    assert tables["nodes"]["node"].tolist()[-3:] == ["L", "E 1", "E 2"]
    spent = energy_table(scenario, evaluation.flights)
    assert spent["node"].unique().tolist()[-3:] == ["L", "H 1", "H 2"]
    jammed = spent[(spent["scheme"] == "proposed") & (spent["node"] == "H 1")]["energy"]
    assert jammed.tolist() == pytest.approx([0.08] * 3)  # p_J Delta
    offloading = offloading_table(scenario, evaluation.flights).query("scheme == 'proposed'")
    assert offloading["relay_2"].all()
    assert not offloading["relay_1"].any()


def test_the_power_of_each_of_several_helpers_is_told(
    relaying_and_jamming: tuple[Scenario, Evaluation], with_power: pd.DataFrame
) -> None:
    scenario, _ = relaying_and_jamming
    flight = read_flight(scenario, with_power, "proposed")
    assert flight.power_level is not None
    assert flight.power_level.tolist() == [[-10.0, -1.0], [-20.0, -2.0], [-30.0, -3.0]]
    assert flight.told_power(2) == [" at -30.0 dB", " at -3.0 dB"]
    nominal = read_flight(scenario, with_power, "optimum")
    assert nominal.power_level is None
    assert nominal.told_power(2) == ["", ""]
    path = flight_tables(scenario, with_power, ["proposed"])[""]
    second = path[path["helper"] == 2]["power_level"].tolist()
    assert second == [pytest.approx(np.nan, nan_ok=True), -1.0, -2.0, -3.0]
    chosen = energy_table(scenario, with_power).dropna(subset="power_level")
    assert set(chosen["scheme"]) == {"proposed"}
    assert chosen.groupby("node")["power_level"].sum().to_dict() == {"H 1": -60.0, "H 2": -6.0}


def test_flights_of_another_number_of_helpers_are_refused(
    relaying_and_jamming: tuple[Scenario, Evaluation],
) -> None:
    scenario, evaluation = relaying_and_jamming
    one = dataclasses.replace(scenario, helper_starts=((0.0, 0.0),))
    with pytest.raises(InputError, match=r"the scenario's 1 helpers, not of 2$"):
        read_flight(one, evaluation.flights, "proposed")


@pytest.mark.parametrize(
    ("relay", "told"),
    [
        ([True], "the helper relays"),
        ([False, True], "H 1 jams, H 2 relays"),
        ([False, True, True, True], "3 of 4 helpers relay"),
    ],
)
def test_modes_are_told_in_words(relay: list[bool], told: str) -> None:
    assert told_modes(np.array(relay)) == told


def test_whose_helper_flies_is_listed_in_the_order_of_the_tables(evaluation: Evaluation) -> None:
    shuffled = evaluation.flights.sample(frac=1.0, random_state=0)
    flying = ["proposed", "re_lt", "ja_lt", "optimum", "ja_optimum", "re_optimum"]
    assert flying_schemes(shuffled) == flying
