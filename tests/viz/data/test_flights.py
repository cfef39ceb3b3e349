import numpy as np

from hyuav import Scenario
from hyuav.experiments.evaluation import Evaluation
from hyuav.viz.data.flights import (
    energy_table,
    flight_tables,
    flying_schemes,
    offloading_table,
    read_flight,
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


def test_whose_helper_flies_is_listed_in_the_order_of_the_tables(evaluation: Evaluation) -> None:
    shuffled = evaluation.flights.sample(frac=1.0, random_state=0)
    flying = ["proposed", "re_lt", "ja_lt", "optimum", "ja_optimum", "re_optimum"]
    assert flying_schemes(shuffled) == flying
