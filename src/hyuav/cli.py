"""The command ``hyuav``: the recipes from any directory, and copies of them to edit."""

import ast
import os
import shutil
import sys
from pathlib import Path
from types import ModuleType

import hyuav
from hyuav._support.errors import InputError, rejection, require_choice

RECIPES = (
    *("train", "evaluate", "reproduce", "compare", "regimes", "fly", "families", "generalist"),
    *("draw", "report", "dashboard"),
)
"""The commands that are recipes, in the order of the help."""

BENCHMARK = "benchmark", "Measure how fast it is beside its peers, in the repository."

COPY = "copy", "Copy a recipe here to edit it: hyuav copy train"

PACKAGE = Path(__file__).parent


def main() -> None:
    """Do what the command line asks for.

    A mistake of the user ends the command with one line and exit status 2.
    """
    name, *arguments = sys.argv[1:] or ["--help"]
    try:
        if name in ("-h", "--help"):
            print(overview())
        elif name == "--version":
            print(f"hyuav {hyuav.__version__}")
        elif name == COPY[0]:
            copy(arguments)
        else:
            require_choice("command", name, (*RECIPES, BENCHMARK[0], COPY[0]))
            run(benchmark() if name == BENCHMARK[0] else recipes() / f"{name}.py", name, arguments)
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)


def overview() -> str:
    """The commands, each on one line."""
    commands = [*((name, _purpose(recipes() / f"{name}.py")) for name in RECIPES), BENCHMARK, COPY]
    lines = [f"  {name:<11}{purpose}" for name, purpose in commands]
    return "\n".join(
        [
            "HyUAV: reinforcement learning for secure offloading by UAV.",
            "",
            "hyuav COMMAND [NAME=VALUE ...]",
            "",
            *lines,
            "",
            "hyuav COMMAND --help   what can be set",
            "hyuav --version        the version",
        ]
    )


def recipes() -> Path:
    """The folder of the recipes: in an installed package, or else in the repository."""
    installed = PACKAGE / "recipes"
    return installed if installed.is_dir() else PACKAGE.parents[1] / "recipes"


def benchmark() -> Path:
    """The file that starts the benchmark, which the repository alone has.

    Raises:
        InputError: this is no copy of the repository.
    """
    file = PACKAGE.parents[1] / "benchmarks" / "__main__.py"
    if not file.is_file():
        how = "pip install --editable '.[bench]' in a copy of the repository"
        raise InputError(f"benchmark is not part of the installed package: {how}")
    sys.path.insert(0, str(file.parents[1]))
    return file


def copy(arguments: list[str]) -> None:
    """Copy a recipe into the working directory, where no file has its name.

    Args:
        arguments: the name of the recipe.

    Raises:
        InputError: not one recipe is named, or the file is there already.
    """
    offered = sorted(file.stem for file in recipes().glob("*.py"))
    name, *more = arguments or [""]
    require_choice("copy", name, offered)
    if more:
        raise InputError(rejection("copy", arguments, "one recipe at a time"))
    file = Path(f"{name}.py")
    content = (recipes() / file).read_bytes()
    try:
        with file.open("xb") as target:
            target.write(content)
    except FileExistsError:
        raise InputError(f"{file} is here already, and is kept as it is") from None
    except OSError as error:
        print(f"error: {file}: {error.strerror}", file=sys.stderr)
        sys.exit(1)
    print(f"{file}: edit it, then call it by python {file}")


def run(file: Path, name: str, arguments: list[str]) -> None:
    """Run a file as Python runs a script, in this process.

    Args:
        file: of a recipe.
        name: by which the command knows it.
        arguments: of the recipe.
    """
    import hyuav._support.start  # noqa: F401 - from here on Ctrl-C ends in one line
    from hyuav._support import program

    program.called[:] = [_own_word(), name]
    sys.argv = [" ".join(program.called), *arguments]
    script = ModuleType("__main__")
    script.__file__ = str(file)
    sys.modules["__main__"] = script  # what a worker process runs first, under another name
    exec(compile(file.read_bytes(), file, "exec"), vars(script))


def _own_word() -> str:
    """What calls this command: its name where the shell finds it, or else its path."""
    path = sys.argv[0]
    found = shutil.which("hyuav")
    here = found is not None and os.path.dirname(found) == os.path.dirname(path)  # noqa: PTH120
    return "hyuav" if here else path


def _purpose(file: Path) -> str:
    """The first line of what a recipe says of itself."""
    return (ast.get_docstring(ast.parse(file.read_bytes())) or "").partition("\n")[0]
