import numpy as np
import pandas as pd

from hyuav import Scenario
from hyuav.experiments.evaluation import Evaluation
from hyuav.viz.data.flights import energy_table, offloading_table, read_flight
from hyuav.viz.paper.over_time import energy_by_slot, offloading_by_slot


def test_the_energy_figure_shows_the_ues_of_the_first_scheme(
    scenario: Scenario, evaluation: Evaluation
) -> None:
    table = energy_table(scenario, evaluation.flights)
    of_ues, of_edge, of_helper = energy_by_slot(table).axes[:3]
    (image,) = of_ues.images
    spent = read_flight(scenario, evaluation.flights, "proposed").energy[:, :10]
    shown = np.asarray(image.get_array(), dtype=float)
    np.testing.assert_allclose(shown, 1e3 * spent.T)  # mJ
    assert list(image.get_extent()) == [0.5, 10.5, 10.5, 0.5]
    for axes, budget in ((of_edge, 24.0), (of_helper, 3.9)):  # J, kJ
        levels = [set(np.atleast_1d(line.get_ydata())) for line in axes.lines]
        assert {budget} in levels


def test_the_offloading_figure_counts_ues_and_leaves_out_who_computes_itself(
    scenario: Scenario, evaluation: Evaluation
) -> None:
    table = offloading_table(scenario, evaluation.flights)
    of_modes, of_ues, of_counts = offloading_by_slot(table).axes[:3]
    proposed = table[table["scheme"] == "proposed"]
    modes = np.asarray(of_modes.images[0].get_array())
    np.testing.assert_array_equal(modes[0] == 2, proposed.groupby("slot")["relay"].first())
    sent = proposed["offloading"].to_numpy().reshape(10, 10).T
    empty = np.ma.getmaskarray(np.ma.asarray(of_ues.images[0].get_array()))
    np.testing.assert_array_equal(empty, ~sent)
    counts = {str(line.get_label()): line.get_ydata() for line in of_counts.lines}
    assert set(counts) == {"Proposed", "Re-LT", "Ja-LT", "No helper"}
    np.testing.assert_array_equal(counts["Proposed"], sent.sum(axis=0))


def test_a_scheme_alone_can_be_drawn(scenario: Scenario, evaluation: Evaluation) -> None:
    alone = read_flight(scenario, evaluation.flights, "ja_lt").rows
    of_modes, *_ = offloading_by_slot(offloading_table(scenario, alone)).axes
    assert [tick.get_text() for tick in of_modes.get_yticklabels()] == ["Ja-LT"]
    assert energy_by_slot(energy_table(scenario, alone)).axes[0].images


def test_each_of_several_helpers_has_its_energies_and_its_modes(
    relaying_and_jamming: tuple[Scenario, Evaluation],
) -> None:
    scenario, evaluation = relaying_and_jamming
    of_nodes = energy_by_slot(energy_table(scenario, evaluation.flights)).axes
    labels = [axes.get_ylabel() for axes in of_nodes]
    assert labels[:4] == ["UE", "Energy of L (J)", "Energy of H 1 (kJ)", "Energy of H 2 (kJ)"]
    of_modes, *_ = offloading_by_slot(offloading_table(scenario, evaluation.flights)).axes
    told = [tick.get_text() for tick in of_modes.get_yticklabels()]
    assert told == ["Proposed, H 1", "Proposed, H 2", "Optimum, H 1", "Optimum, H 2"]
    modes = np.asarray(of_modes.images[0].get_array())
    assert modes.tolist() == [[1] * 3, [2] * 3] * 2  # jamming, relay


def test_each_of_several_helpers_has_its_power(
    relaying_and_jamming: tuple[Scenario, Evaluation], with_power: pd.DataFrame
) -> None:
    scenario, _ = relaying_and_jamming
    of_nodes = energy_by_slot(energy_table(scenario, with_power)).axes[:6]
    assert [axes.get_ylabel() for axes in of_nodes[4:]] == [
        "Power of H 1 (dB)",
        "Power of H 2 (dB)",
    ]
    (own,) = [line for line in of_nodes[5].lines if line.get_label() == "Proposed"]
    assert np.asarray(own.get_ydata(orig=True)).tolist() == [-1.0, -2.0, -3.0]


def test_the_power_is_drawn_where_a_scheme_chooses_it(
    scenario: Scenario, evaluation: Evaluation
) -> None:
    rows = read_flight(scenario, evaluation.flights, "proposed").rows
    level = np.linspace(-60.0, 0.0, len(rows))
    chosen = rows.assign(scheme="proposed_power", power_level=level)
    flights = pd.concat([evaluation.flights, chosen])
    *_, of_power = energy_by_slot(energy_table(scenario, flights)).axes[:4]
    assert of_power.get_ylabel() == "Power of H (dB)"
    (own,) = [line for line in of_power.lines if line.get_label() == "Proposed, power"]
    np.testing.assert_allclose(np.asarray(own.get_ydata(orig=True), dtype=float), level)
    without = energy_by_slot(energy_table(scenario, evaluation.flights))
    assert "Power of H (dB)" not in {axes.get_ylabel() for axes in without.axes}
