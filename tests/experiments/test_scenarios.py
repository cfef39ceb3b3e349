"""Scenarios by name."""

import dataclasses
from pathlib import Path

import pytest

from hyuav import InputError, Scenario, clusters, disk
from hyuav.experiments.comparison.plan import Compare
from hyuav.experiments.scenarios import NAMES, named_scenario, offered


def test_a_scenario_may_name_a_preset_and_change_it() -> None:
    name, scenario = named_scenario({"name": "random_disk", "num_slots": 5})
    assert name == "random_disk"
    assert scenario == dataclasses.replace(Scenario.preset("random_disk"), num_slots=5)


@pytest.mark.parametrize("name", NAMES)
def test_all_that_is_offered_makes_a_scenario_by_its_name_alone(name: str) -> None:
    assert named_scenario({"name": name, **offered(name)}) == named_scenario(name)


def test_a_layout_is_named_by_its_seed_unless_it_has_a_name_of_its_own() -> None:
    fields = {"layout": "disk", "num_ues": 4, "seed": 7, "num_slots": 6}
    scenario = Scenario(ue_positions=disk(4, seed=7), num_slots=6)
    assert named_scenario(fields) == ("disk-7", scenario)
    assert named_scenario({"name": "disk", **fields}) == ("disk-7", scenario)
    assert named_scenario({"name": "campus", **fields}) == ("campus", scenario)


def test_what_was_drawn_is_read_back_as_it_was(tmp_path: Path) -> None:
    name, scenario = named_scenario({"layout": "clusters", "sizes": [2, 5], "seed": 1})
    assert scenario.ue_positions == clusters([2, 5], seed=1)
    scenario.save(tmp_path / "drawn.yaml")
    assert named_scenario({"name": name, **scenario.to_dict()}) == (name, scenario)
    assert Scenario.load(tmp_path / "drawn.yaml") == scenario


def test_an_unknown_name_is_answered_by_all_that_there_are() -> None:
    with pytest.raises(InputError, match=r"^scenario = 'disc': expected one of .*disk.*\?\)$"):
        named_scenario("disc")


def test_a_comparison_takes_presets_layouts_and_fields() -> None:
    drawn = {"name": "loud", "layout": "disk", "seed": 2, "jamming_power": 0.3}
    compared = Compare(scenario=("two_clusters", "disk", drawn), layouts=1).scenarios()
    assert list(compared) == ["two_clusters", "disk-0", "loud", "layout-1000"]
    assert compared["loud"] == Scenario(ue_positions=disk(10, seed=2), jamming_power=0.3)


def test_a_preset_keeps_all_that_is_not_changed() -> None:
    name, scenario = named_scenario({"name": "contested", "num_slots": 5})
    assert name == "contested"
    assert scenario == dataclasses.replace(Scenario.preset("contested"), num_slots=5)


def test_several_helpers_and_eavesdroppers_are_read_back_as_they_were(tmp_path: Path) -> None:
    values = {
        **offered("two_clusters"),
        "helper_starts": [[0.0, 0.0], [10.0, 10.0], [20.0, 0.0]],
        "eavesdropper_positions": [[80.0, 80.0], [-80.0, 80.0]],
        "eavesdroppers": "colluding",
    }
    name, scenario = named_scenario({"name": "crowded", **values})
    assert (scenario.num_helpers, scenario.num_eavesdroppers) == (3, 2)
    scenario.save(tmp_path / "crowded.yaml")
    assert Scenario.load(tmp_path / "crowded.yaml") == scenario
    assert named_scenario({"name": name, **scenario.to_dict()}) == (name, scenario)
