"""The reference of recipes and configuration, from the typed defaults themselves."""

import ast
import importlib.util
import inspect
import itertools
import re
import sys
import textwrap
from collections.abc import Iterable, Iterator
from dataclasses import MISSING, fields
from pathlib import Path
from types import ModuleType
from typing import Any, get_args, get_type_hints

from annotated_types import MinLen
from hydra.core.config_store import ConfigStore
from omegaconf import OmegaConf
from pydantic.fields import FieldInfo

from hyuav._support.parameters import OrOne, Parameters, declared
from hyuav._support.parameters import accepted as words
from hyuav.experiments.tracking import LoggerParameters
from hyuav.learning.learners import Learner
from hyuav.learning.registry import ALGORITHMS, BUILT_IN
from hyuav.physics.families import LAYOUTS
from hyuav.physics.scenario import PRESETS, Scenario

RECIPES = Path(__file__).parents[2] / "recipes"

_GREEK = "alpha|beta|gamma|Delta|epsilon|kappa|sigma|tau"


def recipes_page() -> str:
    """Every recipe: what it is for, how it is called, all that can be set and its default."""
    parts = [
        "# Recipes",
        "The commands of `hyuav` are short scripts: `hyuav copy train` puts one into your "
        "directory to be edited, and `python train.py` then takes the same words. "
        "Anything below can be set by `name=value`, in a section or group by "
        "`section.name=value`; `--cfg job` prints it all, and "
        "`GROUP=FILE.yaml` or `--config-dir DIR` brings files of your own. Paths are told from "
        "where the command is called, whatever `hydra.job.chdir` says; one with `=`, a comma, a "
        "bracket or a letter outside ASCII stands in quotation marks, which the shell must leave "
        "alone: `'run=\"runs/lr=0.1\"'`. The groups `scenario`, `algorithm` and `logger` are "
        "chosen by a name and changed field by field: "
        "[their fields](configuration.md).",
    ]
    for path in sorted(RECIPES.glob("*.py")):
        parts += _recipe(path)
    return "\n\n".join(parts) + "\n"


def configuration_page() -> str:
    """The scenario, the algorithms and the learners, field by field."""
    parts = [
        "# Configuration",
        "What every field means is told with its equation in [The model](../model.md).",
        "## `scenario`",
        "[`hyuav.Scenario`][hyuav.physics.scenario.Scenario]. Presets give `ue_positions`, and "
        "where the paper has no such scenario, more:",
        "\n".join(map(_preset, PRESETS)),
        table(Scenario),
    ]
    for layout, kind in LAYOUTS.items():
        draw = f"hyuav.physics.layout.{layout}"
        parts += [
            f"## `scenario={layout}`",
            f"The fields of `scenario`, but that [`{draw}`][{draw}] draws `ue_positions`, by "
            f"`seed` (0)" + (" and:" if fields(kind) else "."),
            *([table(kind)] if fields(kind) else []),
        ]
    for name in BUILT_IN:
        parameters = ALGORITHMS[name]
        path = f"{parameters.__module__}.{parameters.__qualname__}"
        parts += [f"## `algorithm={name}`", f"[`{path}`][{path}]", table(parameters)]
    parts += [
        "## `logger`",
        "Of every member; the defaults are those of an environment without variables of W&B "
        "([Tracking](../tracking.md)).",
        table(LoggerParameters, LoggerParameters.defaults()),
        "## `learners`",
        "In a run's `config.yaml`, and in Python: "
        "[`hyuav.Learner`][hyuav.learning.learners.Learner].",
        table(Learner),
    ]
    return "\n\n".join(parts) + "\n"


def _preset(name: str) -> str:
    """An item of a list: a preset and the fields that it gives besides the UEs."""
    paper = Scenario(ue_positions=PRESETS[name].ue_positions).to_dict()
    own = PRESETS[name].to_dict().items()
    given = [f"`{field}={_shown(value)}`" for field, value in own if value != paper[field]]
    return f"- `{name}`" + (f": {', '.join(given)}" if given else "")


def table(parameters: type[Parameters], defaults: dict[str, Any] | None = None) -> str:
    """A row for every field of a record.

    Args:
        parameters: the record.
        defaults: where they differ from the record's own.
    """
    rows: list[tuple[str, ...]] = [("name", "default", "accepted", "unit", "symbol", "meaning")]
    rows += _rows(parameters, defaults)
    filled = [column for column in zip(*rows, strict=True) if any(column[1:])]
    lines = [" | ".join(row).join(("| ", " |")) for row in zip(*filled, strict=True)]
    return "\n".join([lines[0], "|---" * len(filled) + "|", *lines[1:]])


def _rows(
    parameters: type[Parameters], defaults: dict[str, Any] | None, owner: str = ""
) -> Iterator[tuple[str, ...]]:
    """The rows of a record's fields, and after a field that is a record, those of its fields."""
    documented = descriptions(parameters)
    annotations = get_type_hints(parameters, include_extras=True)
    for field in fields(parameters):
        own = field.default if defaults is None else defaults[field.name]
        inner = isinstance(own, Parameters)
        yield (
            f"`{owner}{field.name}`",
            "required" if own is MISSING else "its own" if inner else f"`{_shown(own)}`",
            accepted(annotations[field.name]),
            field.metadata["unit"],
            _symbol(field.metadata["symbol"]),
            documented.get(field.name, ""),
        )
        if isinstance(own, Parameters):
            yield from _rows(type(own), None, f"{owner}{field.name}.")


def accepted(annotation: Any) -> str:
    """What a field of an annotated type takes, lists and null included."""
    info = declared(annotation)
    text = words(annotation)
    if OrOne in info.metadata:
        text = f"{words(get_args(info.annotation)[0])}, or a list"
        if not any(isinstance(check, MinLen) for check in info.metadata):
            text += " of any length"
    optional = type(None) in get_args(FieldInfo.from_annotation(annotation).annotation)
    return f"{text}, or null" if optional else text


def descriptions(parameters: type[Parameters]) -> dict[str, str]:
    """What stands below each field of a record in the source, its base classes included."""
    found: dict[str, str] = {}
    for owner in reversed(parameters.__mro__):
        if issubclass(owner, Parameters):
            body = ast.parse(textwrap.dedent(inspect.getsource(owner))).body[0]
            assert isinstance(body, ast.ClassDef)
            found |= dict(_documented(body.body))
    return found


def _documented(body: list[ast.stmt]) -> Iterator[tuple[str, str]]:
    for field, after in itertools.pairwise(body):
        is_text = isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant)
        if is_text and isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name):
            text = " ".join(inspect.cleandoc(after.value.value).split())  # type: ignore[attr-defined]
            yield field.target.id, re.sub(r":\w+:`([\w.]+)`", _link, text)


def _link(role: re.Match[str]) -> str:
    path = role[1]
    return f"[`{path}`][{path}]" if path.startswith("hyuav.") else f"`{path}`"


def _shown(value: object) -> str:
    if value is None:
        return "null"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_shown, value))}]"
    return f"{value:g}" if isinstance(value, float) else str(value)


def _symbol(name: str) -> str:
    if not name:
        return ""
    latex = re.sub(rf"\b({_GREEK})(?=\b|_)", r"\\\1", name)
    latex = re.sub(r"([_^])(\w\w+)", r"\1{\\mathrm{\2}}", latex)
    return f"${latex}$"


def _recipe(path: Path) -> list[str]:
    module = _load(path)
    purpose, _, calls = (module.__doc__ or "").partition("\n\n")
    if f"{path.stem}.yaml" not in ConfigStore.instance().repo:  # nothing of it can be set
        return [f"## `{path.name}`", purpose, f"```sh\n{calls.strip()}\n```"]
    stored = OmegaConf.to_container(ConfigStore.instance().load(f"{path.stem}.yaml").node)
    assert isinstance(stored, dict)
    node: dict[str, Any] = {str(name): value for name, value in stored.items()}
    members = [entry for entry in node.pop("defaults") if isinstance(entry, dict)]
    groups = {
        group: member
        for entry in members
        for group, member in entry.items()
        if not str(group).startswith("override")
    }
    directory = node.pop("hydra")["run"]["dir"]
    sections = {name: value for name, value in node.items() if isinstance(value, dict)}
    options = {name: value for name, value in node.items() if name not in sections}
    more, _, calls = f"\n\n{calls}".rpartition("\n\n")
    parts = [f"## `{path.name}`", *filter(None, [purpose, more.strip()])]
    parts += [f"```sh\n{calls.strip()}\n```", table(_record(module, options), options)]
    if groups:
        chosen = ", ".join(f"`{group}={member}`" for group, member in groups.items())
        parts.append(f"Groups: {chosen}. [Their fields](configuration.md).")
    for name, values in sections.items():
        parts += [f"`{name}`:", table(_record(module, values), values)]
    if directory != "." and "${output}" not in directory:
        parts.append(f"Writes to `{directory}`.")
    return parts


def _load(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(f"recipe_{path.stem}", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # where the source of its classes is looked for
    spec.loader.exec_module(module)
    return module


def _record(module: ModuleType, names: Iterable[str]) -> type[Parameters]:
    """The record with just these fields that a recipe has imported or defined."""
    for value in vars(module).values():
        if isinstance(value, type) and issubclass(value, Parameters):
            own = {field.name for field in fields(value)}
            if own == set(names):
                return value
    raise LookupError(f"{module.__name__}: no record has the fields {sorted(names)}")
