"""What the pages name is there: modules, functions, files and options."""

import dataclasses
import pkgutil
import re
from pathlib import Path

import pytest

from hyuav import EvaluationParameters, Guide, Scenario, TrainingParameters
from hyuav._support.parameters import Parameters
from hyuav.experiments.tracking.parameters import LoggerParameters
from hyuav.learning.registry import ALGORITHMS
from hyuav.physics.families import LAYOUTS

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
SOURCES = [*PAGES, ROOT / "Makefile", *sorted((ROOT / "sweeps").iterdir())]
FOLDERS = "src|docs|tests|recipes|examples|sweeps|benchmarks|ci"
BESIDE = {"persistence", "seed"}
"""An option of the algorithm that a tutorial writes, and what draws a layout."""

RECORDS: dict[str, list[type[Parameters]]] = {
    "algorithm": list(ALGORITHMS.values()),
    "algorithm.guide": [Guide],
    "evaluation": [EvaluationParameters],
    "logger": [LoggerParameters],
    "scenario": [Scenario, *LAYOUTS.values()],
    "training": [TrainingParameters],
}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_every_dotted_name_leads_to_code(page: Path) -> None:
    named = set(re.findall(r"\bhyuav(?:\.[A-Za-z_]\w*)+", page.read_text(encoding="utf-8")))
    for name in named - {"hyuav.algorithms", "hyuav.rewards"}:  # groups of entry points
        pkgutil.resolve_name(name)


@pytest.mark.parametrize("page", SOURCES, ids=lambda page: page.name)
def test_every_file_is_there(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    for path in re.findall(rf"(?<![\w./:-])((?:{FOLDERS})/[\w./-]*\w)", text):
        assert (ROOT / path).exists(), path
    for path in re.findall(r"(?<![\w./])hyuav/[\w/]+\.py\b", text):
        assert (ROOT / "src" / path).exists(), path


@pytest.mark.parametrize("page", SOURCES, ids=lambda page: page.name)
def test_every_option_is_a_field(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    for group, option in re.findall(rf"\b({'|'.join(RECORDS)})\.([a-z]\w*)[=:]", text):
        known = {field.name for record in RECORDS[group] for field in dataclasses.fields(record)}
        assert option in known | BESIDE, f"{group}.{option}"
