"""A page that stands in one file: its text, its figures and all that draws them."""

import base64
import hashlib
from collections.abc import Mapping, Sequence
from functools import cache
from importlib.resources import files
from typing import Any, NamedTuple, TypeAlias

import plotly.graph_objects as go
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
from plotly.io import to_json
from plotly.offline import get_plotlyjs

Drawing: TypeAlias = go.Figure | dict[str, Any]
"""A figure of Plotly's, or the same in plain values."""


class Picture(NamedTuple):
    """A figure, or several of which the reader chooses one."""

    title: str
    """Tells what is chosen among."""
    figures: Mapping[str, Drawing]
    """By their names."""
    small: bool = False
    """Whether several stand side by side on a wide page."""

    @property
    def height(self) -> int:
        """Of the largest in pixels, which is kept free until it is drawn."""
        return max(int(figure["layout"]["height"]) for figure in self.figures.values())


class Section(NamedTuple):
    """A part of the page with a heading of its own."""

    title: str
    notes: Sequence[str] = ()
    pictures: Sequence[Picture] = ()
    tables: Sequence[Markup] = ()

    @property
    def anchor(self) -> str:
        """The heading's place in the page's address."""
        return self.title.lower().replace(" ", "-")


class Page(NamedTuple):
    """What a report tells."""

    kind: str
    """Of what it is about, such as ``Run``."""
    title: str
    facts: Mapping[str, str]
    sections: Sequence[Section]


def render(page: Page) -> str:
    """The page as HTML, which asks for nothing beyond itself and says so to the browser."""
    environment = Environment(
        loader=PackageLoader("hyuav.viz.html"), autoescape=True, undefined=StrictUndefined
    )
    environment.filters["data"] = _data
    script, style = (_asset(name) for name in ("page.js", "page.css"))
    plotly = _plotly()
    return environment.get_template("page.html").render(
        page=page,
        style=Markup(style),
        plotly=Markup(plotly),
        script=Markup(script),
        sources=" ".join(map(_source, (plotly, script))),
    )


def _data(figure: Drawing) -> Markup:
    """A figure as JSON that may stand in a script element."""
    text = str(to_json(figure, validate=False))
    for character in "<>&\u2028\u2029":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return Markup(text)


@cache
def _plotly() -> str:
    """The library that draws the figures."""
    return f"\n{get_plotlyjs()}\n"


def _asset(name: str) -> str:
    text = files("hyuav.viz.html").joinpath("templates", name).read_text(encoding="utf-8")
    return f"\n{text}"


def _source(script: str) -> str:
    """What allows a browser this script alone (Content Security Policy)."""
    digest = hashlib.sha256(script.encode("utf-8")).digest()
    return f"'sha256-{base64.b64encode(digest).decode('ascii')}'"
