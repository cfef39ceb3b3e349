"""What the pages tell the reader to type is a command of the shell."""

import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
_FENCE = re.compile(r"^```sh\b[^\n]*\n(.*?)^```$", re.DOTALL | re.MULTILINE)

COMMANDS = [
    (page, block) for page in PAGES for block in _FENCE.findall(page.read_text(encoding="utf-8"))
]


@pytest.mark.parametrize(
    ("page", "block"), COMMANDS, ids=[str(page.relative_to(ROOT)) for page, _ in COMMANDS]
)
def test_a_shell_reads_it(page: Path, block: str) -> None:
    read = subprocess.run(["bash", "-n"], input=block, capture_output=True, text=True, check=False)
    assert (read.returncode, read.stderr) == (0, ""), page
