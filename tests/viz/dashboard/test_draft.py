import dataclasses
from pathlib import Path

import pytest

from hyuav import Scenario
from hyuav._support.errors import InputError
from hyuav.experiments.run_directory import RunDirectory
from hyuav.viz.dashboard import draft as drafts
from recipe_calls import TINY, Call

SCENARIO = Scenario.preset("two_clusters")


def test_every_field_of_a_scenario_can_be_edited_once() -> None:
    edited = [
        *drafts.NODES,
        drafts.COLLUSION,
        *(n for group in drafts.GROUPS.values() for n in group),
    ]
    assert sorted(edited) == sorted(field.name for field in dataclasses.fields(Scenario))


@pytest.mark.parametrize("name", [n for n, kind in drafts.KINDS.items() if kind is str])
def test_every_choice_that_is_offered_is_accepted_and_no_other(name: str) -> None:
    for value in drafts.CHOICES[name]:
        assert getattr(Scenario.from_dict({**SCENARIO.to_dict(), name: value}), name) == value
    with pytest.raises(InputError) as refused:
        Scenario.from_dict({**SCENARIO.to_dict(), name: "neither"})
    assert str(refused.value).endswith(f"one of {', '.join(drafts.CHOICES[name])}")


def test_what_is_shown_of_a_number_reads_as_the_same_number() -> None:
    for name in (n for group in drafts.GROUPS.values() for n in group):
        if drafts.KINDS[name] not in (bool, str, int):
            value = getattr(SCENARIO, name)
            typed = {**SCENARIO.to_dict(), name: drafts.read(name, drafts.shown(value))}
            assert Scenario.from_dict(typed) == SCENARIO


@pytest.mark.parametrize(
    ("name", "text", "line"),
    [
        ("ue_power", "much", "ue_power = 'much': expected a number in [0, 1e+06]"),
        ("ue_power", "", "ue_power = '': expected a number in [0, 1e+06]"),
        ("noise_power", "0", "noise_power = 0.0: expected a number in [1e-24, 1e+06]"),
        ("max_speed", "nan", "max_speed = nan: expected a number in [1e-09, 1e+09]"),
        ("task_size", "5", "task_size = [5.0]: expected two numbers (low, high)"),
        ("task_size", "9, 5", "task_size = [9.0, 5.0]: expected two numbers (low, high)"),
    ],
)
def test_what_cannot_be_a_value_is_refused_by_the_scenario(name: str, text: str, line: str) -> None:
    with pytest.raises(InputError) as refused:
        Scenario.from_dict({**SCENARIO.to_dict(), name: drafts.read(name, text)})
    assert str(refused.value).startswith(line)


def test_nodes_are_moved_added_and_taken_away() -> None:
    draft = SCENARIO.to_dict()
    draft = drafts.moved(draft, "eavesdropper (E)", (70.0, -5.0))
    draft = drafts.moved(draft, "UE 2", (1.0, 2.0))
    draft, name = drafts.with_node(draft, "ue_positions", (3.0, 4.0))
    assert name == "UE 11"
    draft = drafts.without_node(draft, "UE 1")
    changed = Scenario.from_dict(draft)
    assert changed.eavesdropper_positions[0] == (70.0, -5.0)
    assert changed.ue_positions[0] == drafts.position(draft, "UE 1") == (1.0, 2.0)
    assert changed.ue_positions[-1] == (3.0, 4.0)
    assert changed.num_ues == SCENARIO.num_ues == len(drafts.nodes(draft)) - 3
    assert set(drafts.changes(changed, SCENARIO)) == {"eavesdropper_positions", "ue_positions"}


def test_one_of_several_helpers_is_moved_and_the_others_stay() -> None:
    draft = Scenario.preset("contested").to_dict()
    draft, name = drafts.with_node(draft, "helper_starts", (5.0, 6.0))
    assert name == "helper's start (H) 3"
    draft = drafts.moved(draft, "helper's start (H) 2", (1.0, 2.0))
    draft = drafts.moved(draft, "eavesdropper (E) 1", (3.0, 4.0))
    changed = Scenario.from_dict(draft)
    assert changed.helper_starts == ((0.0, 0.0), (1.0, 2.0), (5.0, 6.0))
    assert changed.eavesdropper_positions == ((3.0, 4.0), (60.0, 55.0))
    assert drafts.position(draft, "helper's start (H) 2") == (1.0, 2.0)
    draft = drafts.without_node(draft, "helper's start (H) 1")
    assert Scenario.from_dict(draft).helper_starts == ((1.0, 2.0), (5.0, 6.0))


@pytest.mark.parametrize("node", ["eavesdropper (E)", "helper's start (H)", "legitimate UAV (L)"])
def test_the_only_node_of_its_kind_stays(node: str) -> None:
    draft = SCENARIO.to_dict()
    assert not drafts.can_leave(draft, node)
    with pytest.raises(InputError, match="at least one position"):
        drafts.without_node(draft, node)


def test_a_saved_scenario_is_one_that_the_recipes_take(call: Call, tmp_path: Path) -> None:
    mine = dataclasses.replace(SCENARIO, jamming_power=0.5, noise_power=3e-14, fading=False)
    assert drafts.save(mine, tmp_path, "my-scenario").is_file()
    assert drafts.load(tmp_path, "my-scenario") == mine
    call(
        "train",
        f"--config-dir={tmp_path}",
        "scenario=my-scenario",
        "hydra.run.dir=run",
        *TINY,
    )
    trained = RunDirectory(tmp_path / "run").configuration()
    assert (trained.scenario_name, trained.scenario) == ("my-scenario", mine)


@pytest.mark.parametrize(
    "name", ["", "..", "a/b", "../x", "-x", "a.b", "x" * 65, "é", "contested", "disk"]
)
def test_a_name_that_is_no_plain_new_word_is_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match=r"^name = "):
        drafts.save(SCENARIO, tmp_path, name)
    assert not list(tmp_path.rglob("*.yaml"))


def test_a_saved_scenario_gives_way_only_where_that_is_wanted(tmp_path: Path) -> None:
    other = dataclasses.replace(SCENARIO, num_slots=7)
    drafts.save(SCENARIO, tmp_path, "mine")
    with pytest.raises(InputError, match="one that is not taken"):
        drafts.save(other, tmp_path, "mine")
    assert drafts.load(tmp_path, "mine") == SCENARIO
    drafts.save(other, tmp_path, "mine", replace=True)
    assert drafts.load(tmp_path, "mine") == other


def test_nothing_is_saved_or_loaded_through_a_symbolic_link(tmp_path: Path) -> None:
    outside, root = tmp_path / "outside", tmp_path / "runs"
    outside.mkdir()
    root.mkdir()
    (root / "scenario").symlink_to(outside)
    with pytest.raises(InputError, match="a place below"):
        drafts.save(SCENARIO, root, "mine")
    SCENARIO.save(outside / "theirs.yaml")
    assert drafts.saved(root) == []
    assert [path.name for path in outside.iterdir()] == ["theirs.yaml"]


def test_a_scenario_that_was_damaged_is_refused_by_name(tmp_path: Path) -> None:
    drafts.save(SCENARIO, tmp_path, "mine").write_text("ue_positions: 3\n")
    with pytest.raises(InputError, match=r"mine\.yaml"):
        drafts.load(tmp_path, "mine")
