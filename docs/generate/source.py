"""What the API reference is told of the source: links for roles, plain defaults of parameters."""

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


class Defaults(griffe.Extension):
    """Show ``parameter(default)`` as the default, and pydantic's dataclasses as dataclasses."""

    def on_alias_instance(self, *, alias: griffe.Alias, **_: Any) -> None:
        """Let the decorator be the one whose fields griffe knows to be parameters."""
        if alias.target_path == "pydantic.dataclasses.dataclass":
            alias.target_path = "dataclasses.dataclass"

    def on_attribute_instance(self, *, attr: griffe.Attribute, **_: Any) -> None:
        """Put the default in the place of the declaration."""
        declared = attr.value
        if isinstance(declared, griffe.ExprCall) and str(declared.function) == "parameter":
            default = list(declared.arguments)
            by_name = not default or isinstance(default[0], griffe.ExprKeyword)
            attr.value = None if by_name else default[0]


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
