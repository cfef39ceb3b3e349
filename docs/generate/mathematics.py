"""Equations as drawings, which need no script, font or network, and links between readings."""

import html
import re
from collections.abc import Iterator
from functools import cache

from matplotlib.font_manager import FontProperties
from matplotlib.path import Path as Outline
from matplotlib.textpath import TextPath, text_to_path

_MATH = re.compile(
    r'<(span|div) class="arithmatex">(?:\\\((.*?)\\\)|\\\[(.*?)\\\])</\1>', re.DOTALL
)
_AS_MATPLOTLIB = {
    r"\lvert": "|",
    r"\rvert": "|",
    r"\lbrace": r"\{",
    r"\rbrace": r"\}",
    r"\gt": ">",
    r"\le": r"\leq",
    r"\ge": r"\geq",
}
"""Commands that mean the same in Matplotlib's subset of TeX."""

_COMMANDS = {Outline.MOVETO: "M", Outline.LINETO: "L", Outline.CURVE3: "Q", Outline.CURVE4: "C"}
_UNITS_PER_EM = 10.0


def to_svg(latex: str) -> str:
    """One equation as an inline drawing in the color of the text around it.

    Args:
        latex: without delimiters, in what Matplotlib knows of TeX and :data:`_AS_MATPLOTLIB`.

    Raises:
        ValueError: it is not.
    """
    width, height, depth, outline = _drawing(" ".join(latex.split()))
    size = "; ".join(
        f"{name}: {units / _UNITS_PER_EM:.3f}em"
        for name, units in (("width", width), ("height", height), ("vertical-align", -depth))
    )
    box = f"0 {depth - height:.2f} {width:.2f} {height:.2f}"
    return (
        f'<svg class="equation" role="img" aria-label="{html.escape(latex)}" style="{size}" '
        f'viewBox="{box}"><path fill="currentColor" d="{outline}"/></svg>'
    )


def link_readings(markdown: str) -> str:
    """Make the readings, such as ``- **[R4] Title``, the targets of the marks that name them."""
    anchored = re.sub(
        r"^- \*\*\[([RF]\d+)\]",
        lambda found: f'- <a id="{found[1].lower()}"></a>**\\[{found[1]}\\]',
        markdown,
        flags=re.MULTILINE,
    )
    return re.sub(
        r"(?<!\\)\[([RF]\d+)\]",
        lambda found: f"[\\[{found[1]}\\]](#{found[1].lower()})",
        anchored,
    )


def render(page: str) -> str:
    """A page's HTML with the equations that Arithmatex marked drawn.

    What stands on lines of its own may be broken where the equation has a ``qquad``.
    """

    def replace(found: re.Match[str]) -> str:
        if found[2] is not None:
            return to_svg(html.unescape(found[2]))
        parts = html.unescape(found[3]).replace(r"\frac", r"\dfrac").split(r"\qquad")
        return f'<div class="equations">{"".join(map(to_svg, parts))}</div>'

    return _MATH.sub(replace, page)


@cache
def _drawing(latex: str) -> tuple[float, float, float, str]:
    """Width, height and depth below the baseline, and the outline as SVG writes it."""
    for command, same in _AS_MATPLOTLIB.items():
        latex = re.sub(rf"{re.escape(command)}(?![a-z])", same.replace("\\", r"\\"), latex)
    text, font = f"${latex}$", FontProperties(size=_UNITS_PER_EM, math_fontfamily="dejavusans")
    outline = TextPath((0, 0), text, size=_UNITS_PER_EM, prop=font)
    size = text_to_path.get_text_width_height_descent(text, font, ismath=True)
    return (*size, " ".join(_segments(outline)))


def _segments(outline: Outline) -> Iterator[str]:
    for points, code in outline.iter_segments(simplify=False):
        if code == Outline.CLOSEPOLY:
            yield "Z"
        elif code in _COMMANDS:
            numbers = " ".join(
                f"{-value if index % 2 else value:.2f}" for index, value in enumerate(points)
            )
            yield f"{_COMMANDS[code]}{numbers}"
