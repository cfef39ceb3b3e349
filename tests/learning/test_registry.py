"""A user's own algorithms beside those of the library."""

import copy
import pickle
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
from hyuav.learning.registry import ALGORITHMS

OWN = """
from hyuav import DDPG
from hyuav._support.parameters import NonNegativeNumber, parameter
from pydantic.dataclasses import dataclass

@dataclass(frozen=True)
class Own(DDPG):
    boldness: NonNegativeNumber = parameter(2.0)
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
    for name in ("hyuav_own_own", "bold_package"):
        sys.modules.pop(name, None)


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


def written(directory: Path, program: str = OWN, name: str = "own.py") -> str:
    directory.mkdir(exist_ok=True)
    (directory / name).write_text(program)
    return f"{directory / name}:Own"


def test_a_class_of_a_file_is_found_by_a_name_once_the_file_was_named(tmp_path: Path) -> None:
    reference = written(tmp_path)
    with pytest.raises(InputError, match=r"^algorithm = 'own.py:Own': expected .* you name"):
        ALGORITHMS.find("own.py:Own")
    assert ALGORITHMS.run_own(reference) == "own.py:Own"
    name, algorithm = named_algorithm({"name": "own.py:Own", "boldness": 3})
    assert (name, algorithm.to_dict()["boldness"]) == ("own.py:Own", 3.0)
    assert ALGORITHMS.run_own(reference) == "own.py:Own"


def test_what_a_run_names_is_not_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    written(tmp_path, "raise SystemExit('it was run')\n")
    for name in ("own.py:Own", "./own.py:Own", str(tmp_path / "own.py:Own"), "own", "os:system"):
        with pytest.raises(InputError, match=r"^algorithm = [^\n]*$"):
            named_algorithm({"name": name})


def test_parameters_of_a_file_reach_a_process_that_has_not_run_it(tmp_path: Path) -> None:
    name = ALGORITHMS.run_own(written(tmp_path))
    sent = pickle.dumps((ALGORITHMS[name](boldness=5.0), name))  # type: ignore[call-arg]
    received = subprocess.run(
        [
            sys.executable,
            "-c",
            "import pickle, sys\n"
            "own, name = pickle.load(sys.stdin.buffer)\n"
            "from hyuav.learning.registry import ALGORITHMS\n"
            "print(own.boldness, ALGORITHMS.find(name) is type(own))",
        ],
        input=sent,
        capture_output=True,
        check=True,
    )
    assert received.stdout == b"5.0 True\n"
    assert copy.deepcopy(ALGORITHMS[name]()) == ALGORITHMS[name]()


def test_files_of_one_name_are_not_taken_for_each_other(tmp_path: Path) -> None:
    ALGORITHMS.run_own(written(tmp_path / "a"))
    with pytest.raises(InputError, match=r"expected files of different names"):
        ALGORITHMS.run_own(written(tmp_path / "b"))


@pytest.mark.parametrize("name", ["missing.py", "directory.py", "text.txt", "a-b.py", ""])
def test_what_is_no_python_file_is_refused(tmp_path: Path, name: str) -> None:
    (tmp_path / "directory.py").mkdir()
    for other in ("text.txt", "a-b.py"):
        (tmp_path / other).write_text(OWN)
    with pytest.raises(InputError, match=r"^algorithm = .*: expected a Python file$"):
        ALGORITHMS.run_own(f"{tmp_path / name}:Own")


@pytest.mark.parametrize("kind", ["Missing", "parameter", "Count", ""])
def test_what_is_no_algorithm_of_a_file_is_refused(tmp_path: Path, kind: str) -> None:
    written(tmp_path, OWN.replace("import NonN", "import Count, NonN"))
    with pytest.raises(InputTypeError, match="subclass of AlgorithmParameters"):
        ALGORITHMS.run_own(f"{tmp_path / 'own.py'}:{kind}")


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
    reference = written(tmp_path / ("a" * 90), program)  # too long a path to be shown whole
    line = rf"^algorithm = '[^\n]*...: expected a Python file that runs \({reason}[^\n]*\)$"
    with pytest.raises(InputError, match=line):
        ALGORITHMS.run_own(reference)
    assert "hyuav_own_own" not in sys.modules


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """The name that an installed package offers an algorithm by."""
    (tmp_path / "bold_package.py").write_text(OWN)
    metadata = tmp_path / "bold_package-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text("Name: bold-package\nVersion: 1.0\n")
    entries = "[hyuav.algorithms]\nbold = bold_package:Own\nbroken = bold_package:Missing\n"
    (metadata / "entry_points.txt").write_text(entries)
    monkeypatch.syspath_prepend(tmp_path)
    return "bold"


def test_an_installed_package_offers_its_algorithm_by_an_entry_point(installed: str) -> None:
    name, algorithm = named_algorithm({"name": installed, "boldness": 3})
    assert (name, algorithm.to_dict()["boldness"]) == ("bold", 3.0)
    with pytest.raises(InputError, match=r"^algorithm = 'broken': expected a package that loads"):
        ALGORITHMS.find("broken")
    with pytest.raises(InputError, match=r"did you mean 'bold'\?"):
        ALGORITHMS.find("bolt")
