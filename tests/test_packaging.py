"""The distributions are complete, and the wheel works without the repository."""

import ast
import os
import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path
from typing import Any

import pytest

import hyuav

ROOT = Path(__file__).parents[1]
PROJECT: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
BESIDE_THE_CODE = (
    "CHANGELOG.md",
    "CITATION.cff",
    "LICENSE",
    "MANIFEST.in",
    "README.md",
    "pyproject.toml",
    "setup.py",
)
EXAMPLE = ROOT / "examples" / "first_training.py"


@pytest.fixture(scope="module")
def dist(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A directory with the sdist, and the wheel that was built from it."""
    source = tmp_path_factory.mktemp("source")
    for name in BESIDE_THE_CODE:
        shutil.copy(ROOT / name, source)
    leave = shutil.ignore_patterns("__pycache__", "*.egg-info")
    for name in ("src", "tests", "recipes", "benchmarks"):
        shutil.copytree(ROOT / name, source / name, ignore=leave)
    command = [sys.executable, "-m", "build", "--no-isolation", f"--outdir={source}/dist"]
    built = subprocess.run([*command, source], capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr
    return source / "dist"


@pytest.fixture(scope="module")
def installed(dist: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A directory with nothing but the installed wheel."""
    target = tmp_path_factory.mktemp("installed")
    (wheel,) = dist.glob("*.whl")
    options = ["--quiet", "--no-index", "--no-deps", "--no-compile", "--target", str(target)]
    subprocess.run([sys.executable, "-m", "pip", "install", *options, str(wheel)], check=True)
    return target


def run(installed: Path, directory: Path, *arguments: str) -> str:
    """What Python prints, with the installed wheel in place of the repository."""
    environment = {**os.environ, "PYTHONPATH": str(installed), "OMP_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, *arguments],
        cwd=directory,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.slow
def test_the_wheel_holds_the_library_the_recipes_and_nothing_else(dist: Path) -> None:
    (wheel,) = dist.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
        entry_points = archive.read(f"{wheel.name.split('-py3')[0]}.dist-info/entry_points.txt")
    source = ROOT / "src"
    library = {str(path.relative_to(source)) for path in source.rglob("*.py*") if path.is_file()}
    library = {name for name in library if "__pycache__" not in name}
    folders = source / "hyuav/viz/html/templates", source / "hyuav/learning/generalist/weights"
    files = [path for folder in folders for path in folder.iterdir()]
    data = {"hyuav/py.typed", *(str(path.relative_to(source)) for path in files)}
    recipes = {f"hyuav/recipes/{path.name}" for path in (ROOT / "recipes").glob("*.py")}
    assert min(len(library), len(data), len(recipes)) > 1
    beside = {name for name in names if not name.startswith("hyuav-")}
    assert beside == library | data | recipes
    assert entry_points.decode().split("\n")[:2] == ["[console_scripts]", "hyuav = hyuav.cli:main"]


@pytest.mark.slow
def test_the_sdist_holds_what_the_wheel_is_built_from(dist: Path) -> None:
    (sdist,) = dist.glob("*.tar.gz")
    with tarfile.open(sdist) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    assert {*BESIDE_THE_CODE, "src/hyuav/py.typed", "recipes/train.py"} <= names
    assert not any(name.startswith(("tests", "benchmarks")) for name in names)


@pytest.mark.slow
def test_the_wheel_makes_environments_and_presets(installed: Path, tmp_path: Path) -> None:
    program = (
        "import gymnasium, hyuav\n"
        "env = gymnasium.make('hyuav/SecureOffloading-v0', scenario='random_disk')\n"
        "observation, _ = env.reset(seed=0)\n"
        "print(hyuav.__file__, observation.shape, hyuav.Scenario.preset('two_clusters').num_ues)\n"
        "import hyuav.viz.html.page\n"
    )
    shown = run(installed, tmp_path, "-c", program)
    assert shown.split(maxsplit=1) == [str(installed / "hyuav/__init__.py"), "(15,) 10\n"]


@pytest.mark.slow
def test_the_wheel_brings_the_command_and_its_recipes(installed: Path, tmp_path: Path) -> None:
    command = [str(installed / "bin" / "hyuav")]
    version = run(installed, tmp_path, *command, "--version")
    assert version == f"hyuav {hyuav.__version__}\n"
    assert "reproduce" in run(installed, tmp_path, *command, "--help")
    assert "resume=runs/NAME" in run(installed, tmp_path, *command, "train", "--help")
    run(installed, tmp_path, *command, "copy", "train")
    copied = tmp_path / "train.py"
    assert copied.read_bytes() == (ROOT / "recipes" / "train.py").read_bytes()
    assert "resume=runs/NAME" in run(installed, tmp_path, copied.name, "--help")


@pytest.mark.slow
def test_the_five_line_example_trains_with_the_wheel(installed: Path, tmp_path: Path) -> None:
    shutil.copy(EXAMPLE, tmp_path)
    lines = run(installed, tmp_path, EXAMPLE.name).splitlines()
    told = [line for line in lines if re.fullmatch(r"episode \d+: -?\d+\.\d\d bps/Hz", line)]
    assert len(told) == 20


def test_the_example_has_five_lines() -> None:
    purpose, *statements = ast.walk(ast.parse(EXAMPLE.read_text()))
    del purpose
    lines = {node.lineno for node in statements if isinstance(node, ast.stmt)}
    assert len(lines) - 1 == 5  # the first is the docstring


def test_changelog_and_citation_are_of_this_version() -> None:
    version = hyuav.__version__
    changelog = (ROOT / "CHANGELOG.md").read_text()
    latest = re.search(r"^## (\S+) - (unreleased|\d{4}-\d\d-\d\d)$", changelog, flags=re.MULTILINE)
    assert latest is not None
    assert latest[1] == version
    assert f"version: {version}\n" in (ROOT / "CITATION.cff").read_text()


def test_this_python_is_one_of_those_stated() -> None:
    lowest = tuple(map(int, PROJECT["requires-python"].removeprefix(">=").split(".")))
    assert sys.version_info >= lowest
    named = "Programming Language :: Python :: {}.{}".format(*lowest)
    assert named in PROJECT["classifiers"]


def test_the_extras_are_there() -> None:
    extras = {
        "bench",
        "cluster",
        "dashboard",
        "docs",
        "dev",
        "export",
        "multiagent",
        "sb3",
        "tensorboard",
        "video",
    }
    assert extras == set(PROJECT["optional-dependencies"])
