"""The documentation builds strictly, draws its equations and asks the network for nothing."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from mathematics import link_readings, render

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
_FETCHED = re.compile(
    r"""<(?:script|img|iframe|source)\b[^>]*\bsrc=["']?https?:|<link\b[^>]*\bhref=["']?https?:"""
)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("site")
    built = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--quiet", "--strict", "--site-dir", directory],
        cwd=ROOT,
        env={**os.environ, "NO_MKDOCS_2_WARNING": "1", "PYTHONPATH": str(ROOT / "src")},
        capture_output=True,
        text=True,
        check=False,
    )
    said = built.stdout + built.stderr
    assert built.returncode == 0, said
    assert "WARNING" not in said
    return directory


def test_every_equation_of_the_model_is_drawn(site: Path) -> None:
    page = (site / "model.html").read_text(encoding="utf-8")
    source = (ROOT / "docs" / "model.md").read_text(encoding="utf-8")
    assert page.count('<svg class="equation"') > source.count("$$")
    assert "arithmatex" not in page


def test_marks_of_readings_lead_to_the_readings(site: Path) -> None:
    page = (site / "model.html").read_text(encoding="utf-8")
    marks = set(re.findall(r'href="#([rf]\d+)"', page))
    assert marks
    assert marks <= set(re.findall(r'id="([rf]\d+)"', page))


def test_no_page_fetches_anything_from_elsewhere(site: Path) -> None:
    pages = sorted(site.rglob("*.html"))
    assert len(pages) > 20
    for page in pages:
        assert not _FETCHED.search(page.read_text(encoding="utf-8")), page.name
    for sheet in site.rglob("*.css"):
        assert not re.search(r"url\(\s*['\"]?https?:|@import", sheet.read_text(encoding="utf-8"))


def test_docstrings_link_to_what_they_name(site: Path) -> None:
    page = (site / "reference" / "api" / "learning.html").read_text(encoding="utf-8")
    assert ":class:`" not in page
    assert 'href="#hyuav.learning.guide.warm_up.WarmUp"' in page


def test_parameters_show_their_defaults(site: Path) -> None:
    page = (site / "reference" / "api" / "physics.html").read_text(encoding="utf-8")
    signature = page[page.index('id="hyuav.physics.scenario.Scenario"') :].partition(
        "</code></pre>"
    )[0]
    text = re.sub(r"<[^>]+>", "", signature)
    assert "num_slots: Slots = 20" in text
    assert "parameter(" not in text


def test_an_equation_stands_in_parts_that_a_narrow_page_may_break() -> None:
    drawn = render(r'<div class="arithmatex">\[a = \frac{b}{c}, \qquad x \gt 0\]</div>')
    assert drawn.count("<svg") == 2
    inline = render(r'<p><span class="arithmatex">\(x &lt; 1\)</span></p>')
    assert 'aria-label="x &lt; 1"' in inline


def test_only_marks_become_links() -> None:
    linked = link_readings("- **[R4] Title.** See **[F7]** and [0, R4].")
    assert linked == r'- <a id="r4"></a>**\[R4\] Title.** See **[\[F7\]](#f7)** and [0, R4].'
