"""A page of the API reference for each room of the library."""

import pkgutil
from collections.abc import Iterator
from importlib.util import find_spec

import hyuav

ROOMS = {
    "physics": "Scenarios and the paper's equations",
    "envs": "Environments",
    "references": "Straight flights and the optimum",
    "learning": "Learning",
    "experiments": "Runs, evaluation, comparison, tracking",
    "viz": "Figures, reports, dashboard",
}
"""Pages and their titles."""

SHARED = {"physics": ("hyuav._support.errors", "hyuav._support.parameters")}
"""Modules that stand beside the packages, by the page that shows them."""


def pages() -> dict[str, str]:
    """The Markdown of each page, by its file's name."""
    return {"index.md": _index(), **{f"{room}.md": _page(room) for room in ROOMS}}


def modules(package: str = "hyuav") -> Iterator[str]:
    """Names of a package's public modules and packages, without importing them."""
    spec = find_spec(package)
    assert spec is not None
    for found in pkgutil.iter_modules(spec.submodule_search_locations or []):
        if not found.name.startswith("_"):
            name = f"{package}.{found.name}"
            yield name
            if found.ispkg:
                yield from modules(name)


def _page(room: str) -> str:
    package = f"hyuav.{room}"
    own = [name for name in modules() if name == package or name.startswith(f"{package}.")]
    shown = dict.fromkeys([*own, *SHARED.get(room, ())])
    return "\n\n".join([f"# {ROOMS[room]}", *map(_directive, shown)])


def _directive(name: str) -> str:
    spec = find_spec(name)
    assert spec is not None
    if spec.submodule_search_locations is None:
        return f"::: {name}"
    return f"::: {name}\n    options: {{members: false}}"  # its modules show what it exports


def _index() -> str:
    exported = {name: getattr(hyuav, name) for name in hyuav.__all__}
    links = [
        f"[`hyuav.{name}`][{value.__module__}.{value.__qualname__}]"
        for name, value in exported.items()
    ]
    rooms = [f"- [{title}]({room}.md)" for room, title in ROOMS.items()]
    return (
        "# Python API\n\n"
        f"What `import hyuav` gives: {', '.join(links)}. All of it, room by room:\n\n"
        + "\n".join(rooms)
        + "\n\nNames that begin with an underscore may change at any time.\n"
    )
