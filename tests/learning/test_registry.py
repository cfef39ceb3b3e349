"""A user's own algorithms beside those of the library."""

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from pydantic.dataclasses import dataclass

from hyuav import InputError, InputTypeError, register
from hyuav._support.parameters import NonNegativeNumber, parameter
from hyuav.experiments.run_directory import named_algorithm
from hyuav.learning.algorithm import AlgorithmParameters
from hyuav.learning.ddpg import DDPG
from hyuav.learning.registry import ALGORITHMS, run_own_files

OWN = """
from hyuav import DDPG, register
from hyuav._support.parameters import NonNegativeNumber, parameter
from pydantic.dataclasses import dataclass

@dataclass(frozen=True)
class Own(DDPG):
    boldness: NonNegativeNumber = parameter(2.0)

register("own", Own)
"""


@dataclass(frozen=True)
class Bold(DDPG):
    boldness: NonNegativeNumber = parameter(2.0)


@dataclass(frozen=True, kw_only=True)
class Demanding(DDPG):
    boldness: NonNegativeNumber = parameter()


@pytest.fixture(autouse=True)
def as_before() -> Iterator[None]:
    before = dict(ALGORITHMS)
    yield
    ALGORITHMS.clear()
    ALGORITHMS.update(before)


def test_a_registered_name_reads_the_configuration_of_its_runs() -> None:
    register("bold", Bold)
    assert named_algorithm({"name": "bold", "boldness": 3.0}) == ("bold", Bold(boldness=3.0))


def test_registering_again_replaces_ones_own() -> None:
    register("bold", DDPG)
    register("bold", Bold)
    assert ALGORITHMS["bold"] is Bold


@pytest.mark.parametrize(
    "name",
    ["ddpg", "Bold", "bold-er", "", "../bold", "bold_robust", "b\n", "stable_baselines3", 3, None],
)
def test_names_that_are_taken_or_are_no_names_are_refused(name: Any) -> None:
    with pytest.raises(InputError, match=r"algorithm = .*: expected .*not taken"):
        register(name, Bold)
    assert ALGORITHMS["ddpg"] is DDPG


@pytest.mark.parametrize("algorithm", [AlgorithmParameters, Demanding, dict, None])
def test_what_cannot_be_created_without_arguments_is_refused(algorithm: Any) -> None:
    with pytest.raises(InputTypeError, match="subclass of AlgorithmParameters"):
        register("bold", algorithm)
    assert "bold" not in ALGORITHMS


def test_files_register_their_algorithms(tmp_path: Path) -> None:
    file = tmp_path / "own.py"
    file.write_text(OWN)
    run_own_files(f"{file}{os.pathsep}")
    assert named_algorithm({"name": "own"})[1].to_dict()["boldness"] == 2.0


@pytest.mark.parametrize("name", ["missing.py", "directory.py", "text.txt"])
def test_what_is_no_python_file_is_refused(tmp_path: Path, name: str) -> None:
    (tmp_path / "directory.py").mkdir()
    (tmp_path / "text.txt").write_text(OWN)
    with pytest.raises(InputError, match=r"HYUAV_ALGORITHMS = .*: expected a Python file"):
        run_own_files(str(tmp_path / name))


@pytest.mark.parametrize(
    ("program", "reason"),
    [
        ("import math\n\nmath.log(-1)\n", "own.py, line 3: ValueError: math domain error"),
        (
            "from hyuav import register, DDPG\nregister('Bold', DDPG)\n",
            "own.py, line 2: InputError: algo",
        ),
        ("numbers = (\n", r"own.py: SyntaxError: '\(' was never closed \(own.py, line 1\)"),
        ("raise SystemExit(3)\n", "own.py, line 1: SystemExit: 3"),
        ("raise KeyboardInterrupt\n", "own.py, line 1: KeyboardInterrupt:"),
    ],
)
def test_a_file_that_fails_is_named_with_the_line_and_the_reason(
    tmp_path: Path, program: str, reason: str
) -> None:
    file = tmp_path / ("a" * 90) / "own.py"  # too long a path to be shown whole
    file.parent.mkdir()
    file.write_text(program)
    line = rf"^HYUAV_ALGORITHMS = '[^\n]*...: expected a Python file that runs \({reason}[^\n]*\)$"
    with pytest.raises(InputError, match=line):
        run_own_files(str(file))
    assert "hyuav_own_own" not in sys.modules


def test_the_environment_variable_is_read_on_import(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(OWN)
    shown = subprocess.run(
        [
            sys.executable,
            "-c",
            "import hyuav.experiments.run_directory as r; print(r.ALGORITHMS['own']().boldness)",
        ],
        env={**os.environ, "HYUAV_ALGORITHMS": str(tmp_path / "own.py")},
        capture_output=True,
        text=True,
        check=True,
    )
    assert shown.stdout.strip() == "2.0"
