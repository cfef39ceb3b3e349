"""Text on the command line: Hydra reads what was meant, also behind a shell."""

import json
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from hydra.core.override_parser.overrides_parser import OverridesParser
from hypothesis import given
from hypothesis import strategies as st
from omegaconf import OmegaConf

from hyuav.experiments.quoting import in_quotes, override

ODD = st.text(alphabet="ab\\\"'${}[]=,() é~:/", max_size=9)
PRINTABLE = st.text(st.characters(exclude_categories=["Cs", "Cc"]), max_size=8)

READ = """
import json, sys
from hydra.core.override_parser.overrides_parser import OverridesParser
read = [own.value() for own in OverridesParser.create().parse_overrides(sys.argv[1:])]
print(json.dumps(read))
"""


@given(ODD | PRINTABLE)
def test_any_text_in_quotation_marks_is_read_as_it_is(text: str) -> None:
    read = OverridesParser.create().parse_override(f"run={in_quotes(text)}").value()
    assert OmegaConf.create({"run": read}).run == text


@pytest.mark.parametrize(
    ("path", "told"),
    [
        (Path.cwd() / "runs" / "one", "run=runs/one"),
        (Path("/somewhere/else"), "run=/somewhere/else"),
        (Path("a b/c"), 'run="a b/c"'),
        (Path("name"), 'run="name"'),
        (Path("runs/lr=0.1"), 'run="runs/lr=0.1"'),
        (Path("läufe/eins"), 'run="läufe/eins"'),
    ],
)
def test_a_path_is_told_as_the_command_line_takes_it(path: Path, told: str) -> None:
    assert override("run", path) == told


def test_a_path_is_read_behind_a_shell_whatever_is_in_it() -> None:
    names = ("läufe", "ein lauf", "lr=0.1,b", "[x]", "a'b", 'a"b', "a$b", "$(ls)", "~", "!x", "`a`")
    paths = [f"runs/{name}/1" for name in names]
    words = [sys.executable, "-c", READ, *(override("run", Path(path)) for path in paths)]
    done = subprocess.run(
        ["bash", "-c", shlex.join(words)], capture_output=True, text=True, check=True
    )
    assert json.loads(done.stdout) == paths
