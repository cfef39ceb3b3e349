"""Hostile names: of runs, scenarios, schemes and files; none leads out or becomes markup."""

from html.parser import HTMLParser
from pathlib import Path

import plotly.graph_objects as go
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hostile import CASES, PAYLOADS, TRIED, attempt, file_names, fuzz, texts
from hyuav import Scenario
from hyuav.viz.dashboard import draft
from hyuav.viz.dashboard.plain import plain
from hyuav.viz.data.index import RunIndex
from hyuav.viz.data.schemes import scheme_label
from hyuav.viz.html import style
from hyuav.viz.html.document import Page, Section, render
from hyuav.viz.html.tables import configuration_tables, html_table

SCENARIO = Scenario(ue_positions=((1.0, 2.0),))

OWN_TAGS = {
    *("div", "table", "caption", "thead", "tbody", "tr", "th", "td", "details", "summary"),
    *("br", "span"),
}


class Tags(HTMLParser):
    """The tags of a page and their attributes."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.found: list[tuple[str, tuple[str, ...]]] = []
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, tuple(name for name, _ in attrs)))


def show(name: str) -> None:
    """As a table's caption, heading and cells, as a figure's text, and as Markdown."""
    content = configuration_tables({name: {name: name, "list": [{name: name}]}, "x": name})
    content += html_table(name, [name], [[name]])
    for tag, attributes in Tags(str(content)).found:
        assert tag in OWN_TAGS
        assert not any(attribute.startswith("on") for attribute in attributes)
    assert "<" not in style.plain(scheme_label(name))
    assert "<" not in plain(name).replace("\\<", "")
    assert "\n" not in plain(name)


@pytest.mark.slow
def test_a_hostile_name_leads_nowhere_and_is_shown_as_text(tmp_path: Path) -> None:
    kind, root = "name", tmp_path / "runs"
    (root / "run").mkdir(parents=True)
    (tmp_path / "outside").write_text("secret")
    (root / "link").symlink_to(tmp_path)
    index = RunIndex(root)

    @fuzz(kind)
    @given(texts | file_names, st.sampled_from(["config.yaml", "checkpoints", "."]))
    def try_one(name: str, part: str) -> None:
        show(name)
        attempt("saved name", lambda: draft.save(SCENARIO, root, name, replace=True))
        attempt("loaded name", lambda: draft.load(root, name))
        found = attempt(kind, lambda: index.file(name, part))
        assert found is None or found.resolve().is_relative_to(root)

    try_one()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["outside", "runs"]
    saved = {path.name for path in root.iterdir()} - {"run", "link"}
    assert saved <= {"scenario"}
    assert sum(TRIED[kind, outcome] for outcome in ("worked", "refused")) >= CASES[kind]


@pytest.mark.parametrize("name", PAYLOADS)
def test_a_payload_is_shown_as_text_and_leads_nowhere(tmp_path: Path, name: str) -> None:
    show(name)
    attempt("saved name", lambda: draft.save(SCENARIO, tmp_path / "runs", name))
    assert {path.name for path in tmp_path.iterdir()} <= {"runs"}


def test_a_page_whose_every_word_is_hostile_has_no_element_of_theirs() -> None:
    def page(text: str) -> Page:
        sections = [Section(text, [text], [], [html_table(text, [text], [[text]])])]
        return Page(text, text, {text: text}, sections)

    ours = Tags(render(page("plain"))).found
    for name in PAYLOADS:
        assert Tags(render(page(name))).found == ours, name


@pytest.mark.parametrize("name", PAYLOADS)
def test_a_figure_ends_no_script(name: str) -> None:
    from hyuav.viz.html.document import _data

    figure = go.Figure(layout={"title": {"text": name.encode("utf-8", "replace").decode()}})
    assert "<" not in _data(figure)
