"""What the pages tell the reader to run is run as it stands, each page in its own directory.

A block with a title is a file that the reader saves. Python blocks of a page share their names, as
in one session; blocks marked ``text`` are not meant to be run here.
"""

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
PAGES = [*sorted((ROOT / "docs" / "tutorials").glob("*.md")), ROOT / "docs" / "index.md"]

OPTIONAL = {
    "stable_baselines3": "stable_baselines3",
    "policy": "onnxruntime",
    "agents": "pettingzoo",
}
"""What a page needs beyond the library."""

_FENCE = re.compile(r'^```(python|sh)(?: title="([\w.]+)")?\n(.*?)^```$', re.DOTALL | re.MULTILINE)


class Block(NamedTuple):
    language: str
    title: str
    code: str


def blocks(page: Path) -> Iterator[Block]:
    for language, title, code in _FENCE.findall(page.read_text(encoding="utf-8")):
        yield Block(language, title, code)


def session(page: Path, directory: Path) -> str:
    """One Python program that does what the page says, block by block."""
    lines = ["import os, subprocess, sys"]
    environment = directory / "environment"
    for block in blocks(page):
        if block.title:
            (directory / block.title).write_text(block.code, encoding="utf-8")
        if block.language == "python":
            name = block.title or page.name
            lines.append(f"exec(compile({block.code!r}, {name!r}, 'exec'))")
        else:
            script = f"set -e\n{block.code}\nenv -0 > {environment}"
            lines.append(f"subprocess.run(['bash', '-c', {script!r}], check=True)")
            lines.append(f"pairs = open({str(environment)!r}).read().split(chr(0))[:-1]")
            lines.append("os.environ.update(pair.split('=', 1) for pair in pairs)")
    return "\n".join(lines)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_what_a_page_tells_to_run_runs(page: Path, tmp_path: Path) -> None:
    if page.stem in OPTIONAL:
        pytest.importorskip(OPTIONAL[page.stem])
    program = session(page, tmp_path)
    environment = {
        **os.environ,
        "MPLBACKEND": "Agg",
        "OMP_NUM_THREADS": "1",
        "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
        "PYTHONPATH": f".{os.pathsep}{ROOT / 'src'}",
    }
    done = subprocess.run(
        [sys.executable, "-c", program],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, f"{done.stdout[-2000:]}\n{done.stderr[-4000:]}"


def test_every_tutorial_has_something_to_run() -> None:
    assert {page.stem for page in PAGES} >= {
        "scenario",
        "algorithm",
        "policy",
        "stable_baselines3",
        "run_data",
    }
    for page in PAGES:
        assert any(block.language == "python" for block in blocks(page)), page.name


def test_the_quick_start_trains_by_the_example() -> None:
    saved = {block.title: block.code for block in blocks(ROOT / "docs" / "index.md")}
    example = ROOT / "examples" / "first_training.py"
    assert saved[example.name] == example.read_text(encoding="utf-8")
