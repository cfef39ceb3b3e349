"""Shared by all tests: one thread, reproducible property tests, environments and recipes."""

import contextlib
import dataclasses
import gc
import importlib.util
import io
import os
import shutil
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import gymnasium
import pytest
import torch
from fontTools.subset import Options
from hypothesis import settings

import hyuav  # noqa: F401 - registers the environments
from hyuav import Scenario
from hyuav.experiments.evaluation import Evaluation, EvaluationParameters, evaluate
from hyuav.references.flight import FlightPolicy
from hyuav.references.optimum import solve_optimum
from hyuav.references.straight import ja_lt, no_helper, re_lt
from recipe_calls import Call, Refusal, forget_own

RECIPES = Path(__file__).parents[1] / "recipes"
BENCHMARKS = Path(__file__).parents[1] / "benchmarks" / "__main__.py"

torch.set_num_threads(1)
os.environ["OMP_NUM_THREADS"] = "1"  # of the processes that tests start
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # nor shall each of them compile all sources
os.environ["TORCHINDUCTOR_DEBUG_COMPILE"] = "1"  # without optimizing, which takes half the time
Options._drop_tables_default += ["GDEF", "GPOS", "GSUB"]  # of fonts; no PDF needs what takes long
gc.freeze()  # or each search for garbage would go through all libraries
gc.set_threshold(10_000, 20, 20)  # and seldom, since what tests leave is little
settings.register_profile("hyuav", deadline=None, max_examples=50, derandomize=True)
settings.load_profile("hyuav")


HERE = "{here}"
"""In what a command printed, in place of the test's directory."""


@pytest.fixture(scope="session")
def make() -> Callable[..., Any]:
    """Make the Gymnasium environment of one helper."""

    def build(scenario: Any = "two_clusters", **kwargs: Any) -> Any:
        return gymnasium.make("hyuav/SecureOffloading-v0", scenario=scenario, **kwargs)

    return build


@pytest.fixture(scope="session")
def make_vec() -> Callable[..., Any]:
    """Make the Gymnasium environment of a batch of helpers."""

    def build(num_envs: int = 3, scenario: Any = "two_clusters", **kwargs: Any) -> Any:
        return gymnasium.make_vec(
            "hyuav/SecureOffloading-v0", num_envs=num_envs, scenario=scenario, **kwargs
        )

    return build


@pytest.fixture(scope="session", params=["make", "make_vec"])
def build(request: pytest.FixtureRequest) -> Any:
    """Either of both."""
    return request.getfixturevalue(request.param)


@pytest.fixture(scope="session")
def scenario() -> Scenario:
    """That of ``evaluation``."""
    return dataclasses.replace(Scenario.preset("two_clusters"), num_slots=10)


@pytest.fixture(scope="session")
def evaluation(scenario: Scenario) -> Evaluation:
    """The straight flights, no helper and the optima; the hybrid one is flown as Proposed too."""
    optima = solve_optimum(scenario, resolution=5.0)
    best = {rule: FlightPolicy(found.path, scenario) for rule, found in optima.items()}
    policies = {
        "re_lt": re_lt(scenario),
        "ja_lt": ja_lt(scenario),
        "no_helper": no_helper(scenario),
        "proposed": best["hybrid"],
        "optimum": best["hybrid"],
        "re_optimum": best["relay"],
        "ja_optimum": best["jamming"],
    }
    return evaluate(scenario, "x", policies, EvaluationParameters(episodes=20, flights=2))


@pytest.fixture
def call(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Call]:
    """Run a recipe with arguments in an empty directory."""

    def run(name: str, *arguments: str) -> None:
        path = BENCHMARKS if name == "benchmark" else RECIPES / f"{name}.py"
        spec = importlib.util.spec_from_file_location(name, path)
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        monkeypatch.setitem(sys.modules, name, module)
        spec.loader.exec_module(module)
        monkeypatch.chdir(tmp_path)
        monkeypatch.setattr(sys, "argv", [name, *arguments])
        module.main()

    yield run
    torch.set_num_threads(1)
    forget_own()


@pytest.fixture(scope="session")
def called_before() -> dict[tuple[tuple[str, ...], ...], tuple[Path, str]]:
    """What recipes left behind and printed, by their names and arguments in the order of calls."""
    return {}


@pytest.fixture
def once(
    call: Call,
    called_before: dict[tuple[tuple[str, ...], ...], tuple[Path, str]],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    tmp_path_factory: pytest.TempPathFactory,
) -> Call:
    """As ``call``, but what came of the same calls in another test is copied.

    For what a test begins with, in a directory in which nothing else is done before.
    """
    calls: tuple[tuple[str, ...], ...] = ()

    def run(*words: str) -> None:
        nonlocal calls
        calls = (*calls, words)
        if calls not in called_before:
            with contextlib.redirect_stdout(io.StringIO()) as printed:
                call(*words)
            kept = tmp_path_factory.mktemp("kept") / "directory"
            shutil.copytree(tmp_path, kept)
            called_before[calls] = kept, printed.getvalue().replace(str(tmp_path), HERE)
        kept, told = called_before[calls]
        shutil.copytree(kept, tmp_path, dirs_exist_ok=True)
        monkeypatch.chdir(tmp_path)
        print(told.replace(HERE, str(tmp_path)), end="")

    return run


@pytest.fixture
def refusal(call: Call, capsys: pytest.CaptureFixture[str]) -> Refusal:
    """Run a recipe that refuses its arguments: its one line, and exit status 2."""

    def run(name: str, *arguments: str) -> str:
        capsys.readouterr()
        with pytest.raises(SystemExit) as stopped:
            call(name, *arguments)
        assert stopped.value.code == 2
        errors = capsys.readouterr().err
        assert "error: " in errors  # behind the program's name where the syntax is at fault
        assert errors.count("\n") == 1
        return errors

    return run
