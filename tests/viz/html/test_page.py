import re
import shutil
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path

import pytest
from plotly.offline import get_plotlyjs

from hyuav import InputError
from hyuav.experiments.run_directory import REPORT_FILE, RunDirectory
from hyuav.viz.html.page import write_report

pytest_plugins = "sample_runs"

Copy = Callable[[RunDirectory], RunDirectory]


class _Outline(HTMLParser):
    """The headings, the places they link to, and the addresses that a page asks for."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.headings: list[str] = []
        self.anchors: set[str] = set()
        self.links: list[str] = []
        self.addresses: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = {name: value or "" for name, value in attrs}
        if re.fullmatch("h[1-6]", tag):
            self.headings.append(tag)
        self.anchors.add(values.get("id", ""))
        if tag == "a":
            self.links.append(values["href"])
        elif "src" in values or "href" in values:
            self.addresses.append(values.get("src", values.get("href", "")))


def _outline(path: Path) -> _Outline:
    return _Outline(path.read_text(encoding="utf-8"))


def test_a_report_is_one_file_that_asks_for_no_other(trained: RunDirectory, copied: Copy) -> None:
    run = copied(trained)
    path = write_report(run.path)
    assert path == run.path / REPORT_FILE
    assert _outline(path).addresses == ["data:,"]
    assert path.read_text(encoding="utf-8").count(get_plotlyjs()[:200]) == 1


def test_the_contents_lead_to_every_section(evaluated: RunDirectory, copied: Copy) -> None:
    outline = _outline(write_report(copied(evaluated).path))
    assert outline.headings[0] == "h1"
    assert outline.headings[1:] == ["h2"] * len(outline.links)
    assert {link.removeprefix("#") for link in outline.links} <= outline.anchors


def test_a_report_says_the_same_when_it_is_written_again(
    evaluated: RunDirectory, copied: Copy
) -> None:
    run = copied(evaluated)
    first = write_report(run.path).read_bytes()
    assert write_report(run.path).read_bytes() == first
    assert not list(run.path.glob(".*.partial"))


def test_an_evaluation_that_is_kept_apart_has_a_report(
    evaluated: RunDirectory, tmp_path: Path
) -> None:
    for name in ("evaluation.json", "flights.parquet"):
        shutil.copy(evaluated.path / name, tmp_path)
    text = write_report(tmp_path).read_text(encoding="utf-8")
    assert "two_clusters" in text
    assert '<option value="1">Proposed</option>' in text


def test_a_run_with_broken_weights_has_a_report_that_says_so(
    trained: RunDirectory, copied: Copy
) -> None:
    run = copied(trained)
    run.best_checkpoint.write_bytes(b"nothing")
    assert "The weights cannot be flown" in write_report(run.path).read_text(encoding="utf-8")


def test_a_directory_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"run = .*: expected an existing directory"):
        write_report(tmp_path / "none")
