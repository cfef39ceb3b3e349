"""Cross-references of docstrings, such as ``:func:`name```, as links of the API reference."""

import re
from collections.abc import Iterator
from typing import Any

import griffe

_ROLE = re.compile(r":(?:attr|class|data|func|meth|mod|exc):`([^`]+)`")


class Roles(griffe.Extension):
    """Rewrite the roles of a loaded package; what the reference does not show becomes code."""

    def on_package(self, *, pkg: griffe.Module, loader: griffe.GriffeLoader, **_: Any) -> None:
        """Rewrite all docstrings of the package."""
        for owner in _objects(pkg):
            if owner.docstring is not None:
                owner.docstring.value = rewritten(owner.docstring.value, owner, loader)


def rewritten(text: str, owner: griffe.Object, loader: griffe.GriffeLoader) -> str:
    """A docstring of ``owner`` with links in place of roles."""
    return _ROLE.sub(lambda found: link(found[1], owner, loader), text)


def link(name: str, owner: griffe.Object, loader: griffe.GriffeLoader) -> str:
    """Markdown for a name as a docstring of ``owner`` uses it."""
    target = _target(name, owner, loader)
    return f"`{name}`" if target is None else f"[`{name}`][{target}]"


def _target(name: str, owner: griffe.Object, loader: griffe.GriffeLoader) -> str | None:
    collection = loader.modules_collection
    first, _, rest = name.partition(".")
    try:
        path = name if first == "hyuav" else ".".join(filter(None, [owner.resolve(first), rest]))
        found = collection[path]
        target = found.final_target if isinstance(found, griffe.Alias) else found
    except (KeyError, griffe.GriffeError):
        return None
    shown = target.is_module or target.docstring is not None
    return target.path if shown and "._" not in target.path else None


def _objects(owner: griffe.Object) -> Iterator[griffe.Object]:
    yield owner
    for member in owner.members.values():
        if isinstance(member, griffe.Object):
            yield from _objects(member)
