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


USED = {"fly": {"matplotlib"}, "train": {"plotly", "jinja2"}}
"""What recipes load besides what both need."""

FORKED = f"""
import os, sys
for program in sys.argv[1:]:
    if os.fork() == 0:
        exec(program)
        print("loaded:", *(own for own in {HEAVY} if own in sys.modules), flush=True)
        os._exit(0)
    os.wait()
"""


def loaded_by(*programs: str, begin: str = "") -> list[list[str]]:
    """The libraries that each program has imported at its end, behind what all begin with."""
    called = [sys.executable, "-c", f"{begin}\n{FORKED}", *programs]
    ran = subprocess.run(called, capture_output=True, text=True, check=True)
    told = (line.partition("loaded:") for line in ran.stdout.splitlines())
    return [libraries.split() for _, mark, libraries in told if mark]


def test_neither_the_import_nor_the_help_loads_a_large_library() -> None:
    asked = "from hyuav.cli import overview; print(overview())"
    assert loaded_by("import hyuav; dir(hyuav)", asked) == [[], []]


def test_a_recipe_loads_no_library_that_it_does_not_use() -> None:
    programs = [f"import runpy; runpy.run_path({str(RECIPES / f'{own}.py')!r})" for own in USED]
    both = {"torch", "torchrl", "pandas", "scipy", "hydra"}
    loaded = loaded_by(*programs, begin="import hyuav.learning")
    assert [set(own) for own in loaded] == [both | used for used in USED.values()]


def test_gymnasium_makes_the_environment() -> None:
    names = {
        "import hyuav, gymnasium": "hyuav/SecureOffloading-v0",
        "import gymnasium": "hyuav:hyuav/SecureOffloading-v0",
    }
    made = "assert gymnasium.make({!r}, scenario='two_clusters').reset()[0].shape == (15,)"
    programs = [f"{first}; {made.format(name)}" for first, name in names.items()]
    begin = "import tensordict, sys; assert 'gymnasium' not in sys.modules"
    assert len(loaded_by(*programs, begin=begin)) == len(programs)
