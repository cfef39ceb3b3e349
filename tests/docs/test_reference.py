"""The generated reference tells all that there is, as it is."""

import dataclasses
import re
from pathlib import Path
from typing import get_type_hints

from api import ROOMS, SHARED, modules, pages
from configuration import accepted, configuration_page, descriptions, recipes_page, table
from hyuav import Guide, Learner, Scenario
from hyuav._support.parameters import OneOrMore, Parameters, Text, ZeroOrMore
from hyuav.experiments.tracking import LoggerParameters
from hyuav.learning.ddpg import DDPG
from hyuav.learning.guide.robust import RobustDDPG
from hyuav.learning.registry import ALGORITHMS
from hyuav.learning.training import TrainingParameters
from hyuav.physics.families import LAYOUTS

ROOT = Path(__file__).parents[2]


def sections(page: str) -> dict[str, str]:
    titled = re.split(r"^## `(.+)`$", page, flags=re.MULTILINE)[1:]
    return dict(zip(titled[::2], titled[1::2], strict=True))


def rows(text: str) -> list[list[str]]:
    lines = [line for line in text.splitlines() if line.startswith("| `")]
    return [[cell.strip() for cell in line.strip("|").split(" | ")] for line in lines]


def test_every_field_of_scenario_algorithms_loggers_and_learners_has_a_row() -> None:
    parts = sections(configuration_page())
    named: dict[str, type[Parameters]] = {"scenario": Scenario, "learners": Learner}
    named |= {f"scenario={name}": parameters for name, parameters in LAYOUTS.items()}
    named["logger"] = LoggerParameters
    named |= {f"algorithm={name}": parameters for name, parameters in ALGORITHMS.items()}
    assert set(parts) == set(named)
    for title, record in named.items():
        listed = [row[0] for row in rows(parts[title])]
        own = [name for name in listed if "." not in name]
        assert own == [f"`{field.name}`" for field in dataclasses.fields(record)]


def test_a_guides_fields_follow_the_field_that_it_is() -> None:
    listed = [row[0] for row in rows(sections(configuration_page())["algorithm=sac_robust"])]
    guide = [f"`guide.{field.name}`" for field in dataclasses.fields(Guide)]
    assert listed[listed.index("`guide`") + 1 :][: len(guide)] == guide


def test_every_recipe_has_a_section_with_its_options() -> None:
    parts = sections(recipes_page())
    assert set(parts) == {path.name for path in (ROOT / "recipes").glob("*.py")}
    train = [row[0] for row in rows(parts["train.py"])]
    assert {"`learners`", "`warm_start`", "`num_episodes`"} <= set(train)
    for file, text in parts.items():
        assert re.search(rf"^hyuav (copy )?{file.removesuffix('.py')}\b", text, re.MULTILINE)


def test_a_recipe_that_changes_a_default_shows_its_own() -> None:
    parts = sections(recipes_page())
    of_compare = {row[0]: row[1] for row in rows(parts["compare.py"])}
    of_train = {row[0]: row[1] for row in rows(parts["train.py"])}
    assert (of_train["`num_episodes`"], of_compare["`num_episodes`"]) == ("`1000`", "`600`")
    assert "`logger=wandb`" in parts["train.py"]
    assert "`logger=none`" in parts["compare.py"]


def test_a_row_gives_default_check_unit_symbol_and_meaning() -> None:
    by_name = {row[0]: row for row in rows(table(Scenario))}
    shown = ["`max_speed`", "`20`", "a number in [1e-09, 1e+09]", "m/s", r"$v_{\mathrm{max}}$"]
    assert by_name["`max_speed`"] == [*shown, ""]
    assert by_name["`power_range`"][-1] == "How far below the nominal power the least is."
    assert by_name["`ue_positions`"][1] == "required"
    geofence = {row[0]: row for row in rows(table(DDPG))}["`geofence`"]
    assert geofence[1:3] == ["`false`", "true or false"]
    assert geofence[-1] == "Slow flights so that they end on the map."


def test_what_is_accepted_is_what_the_check_says() -> None:
    fields = get_type_hints(Learner, include_extras=True)
    assert accepted(fields["scheme"]) == "one of hybrid, relay, jamming"
    assert accepted(fields["num_slots"]) == "a whole number >= 1, or null"
    sizes = get_type_hints(DDPG, include_extras=True)["hidden_sizes"]
    assert accepted(sizes) == "the sizes of at least one hidden layer"
    names = ZeroOrMore[Text]
    assert accepted(names) == "text that is not empty, or a list of any length"
    assert accepted(OneOrMore[Text] | None) == "text that is not empty, or a list, or null"


def test_what_the_source_says_of_a_field_is_found_in_base_classes_too() -> None:
    assert descriptions(TrainingParameters)["cohorts"].startswith("Groups of learners")
    assert descriptions(RobustDDPG)["clock"].startswith("Observe the slots flown.")


def test_every_public_module_is_on_one_page_of_the_api_reference() -> None:
    shown = re.findall(r"^::: (\S+)$", "\n".join(pages().values()), flags=re.MULTILINE)
    private = {name for names in SHARED.values() for name in names if "._" in name}
    assert sorted(shown) == sorted({*modules(), *private})
    assert set(pages()) == {"index.md", *(f"{room}.md" for room in ROOMS)}
