"""What ``import hyuav`` gives, and how little it loads."""

import subprocess
import sys
from pathlib import Path

import pytest

import hyuav

RECIPES = Path(__file__).parents[1] / "recipes"

HEAVY = (
    *("torch", "torchrl", "pandas", "scipy", "matplotlib", "hydra", "wandb"),
    *("plotly", "jinja2", "scipy.stats", "matplotlib.pyplot", "torch._inductor.compile_fx"),
)


@pytest.mark.parametrize("name", hyuav.__all__)
def test_every_public_name_is_there_and_documented(name: str) -> None:
    value = getattr(hyuav, name)
    assert getattr(value, "__name__", name) == name
    assert value.__doc__


def test_all_names_are_imported_and_listed() -> None:
    names: dict[str, object] = {}
    exec("from hyuav import *", names)
    assert set(hyuav.__all__) <= set(names)
    assert {*hyuav.__all__, "__version__"} <= set(dir(hyuav))


def test_a_name_that_is_not_public_is_refused() -> None:
    with pytest.raises(AttributeError, match="module 'hyuav' has no attribute 'Scenari'"):
        _ = hyuav.Scenari  # type: ignore[attr-defined]


def loaded_by(program: str) -> list[str]:
    """The libraries that a program has imported at its end."""
    listed = f"{program}; import sys; print(*(own for own in {HEAVY} if own in sys.modules))"
    ran = subprocess.run([sys.executable, "-c", listed], capture_output=True, text=True, check=True)
    return ran.stdout.splitlines()[-1].split()


def test_neither_the_import_nor_the_help_loads_a_large_library() -> None:
    assert loaded_by("import hyuav; dir(hyuav)") == []
    assert loaded_by("from hyuav.cli import overview; print(overview())") == []


@pytest.mark.parametrize(
    ("recipe", "used"), [("fly", ["scipy", "matplotlib"]), ("train", ["scipy", "plotly", "jinja2"])]
)
def test_a_recipe_loads_no_library_that_it_does_not_use(recipe: str, used: list[str]) -> None:
    program = f"import runpy; runpy.run_path({str(RECIPES / f'{recipe}.py')!r})"
    assert set(loaded_by(program)) == {"torch", "torchrl", "pandas", "hydra", *used}


@pytest.mark.parametrize(
    ("first", "name"),
    [
        ("import hyuav, gymnasium", "hyuav/SecureOffloading-v0"),
        ("import gymnasium", "hyuav:hyuav/SecureOffloading-v0"),
    ],
)
def test_gymnasium_makes_the_environment(first: str, name: str) -> None:
    program = f"{first}; print(gymnasium.make({name!r}, scenario='two_clusters').reset()[0].shape)"
    ran = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert ran.stdout == "(15,)\n"
