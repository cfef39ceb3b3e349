"""What a name chooses: what comes with the package, and what users bring in files and packages."""

import importlib.util
import re
import sys
import traceback
from collections.abc import Callable, Mapping
from importlib.metadata import entry_points
from pathlib import Path
from types import ModuleType
from typing import Any, TypeVar

from hyuav._support.errors import InputError, one_line, rejection, require_choice

Member = TypeVar("Member")


class Registry(dict[str, Member]):
    """The members by name: those of this library, and after them those of users.

    Args:
        members: of this library.
        field: that is set to a name, such as ``algorithm``.
        kind: what a name stands for, with its article.
        group: of the entry points by which installed packages offer members.
        accept: makes a member of what a file or a package holds, given what it is called and, where
            it is of a file, its whole reference. It raises an InputError where that is none.
    """

    def __init__(
        self,
        members: Mapping[str, Member],
        *,
        field: str,
        kind: str,
        group: str,
        accept: Callable[[str, Any, str | None], Member],
    ) -> None:
        super().__init__(members)
        self.field, self.kind, self.group = field, kind, group
        self._accept = accept

    def find(self, name: Any) -> Member:
        """The member of a name, which may be that of an installed package's entry point.

        No file is run: one of ``FILE.py:NAME`` is found only after :meth:`run_own` was given it.

        Raises:
            InputError: there is none of that name, or it cannot be loaded.
        """
        if isinstance(name, str):
            if name in self:
                return self[name]
            for entry in entry_points(group=self.group, name=name):
                self[name] = self._load(name, entry.load)
            if is_reference(name):
                accepted = f"{self.kind} of a file that you name: {self.field}=DIRECTORY/{name}"
                raise InputError(rejection(self.field, name, accepted))
        require_choice(self.field, name, self.names())
        return self[name]

    def _load(self, name: str, load: Callable[[], Any]) -> Member:
        try:
            return self._accept(name, load(), None)
        except Exception as error:  # whichever the package raises
            accepted = f"a package that loads ({one_line(f'{type(error).__name__}: {error}')})"
            raise InputError(rejection(self.field, name, accepted)) from error

    def names(self) -> list[str]:
        """Of all members that :meth:`find` finds."""
        return list(dict.fromkeys([*self, *entry_points(group=self.group).names]))

    def run_own(self, reference: str) -> str:
        """Run a Python file, and let what it holds under a name be chosen.

        Args:
            reference: ``FILE.py:NAME``.

        Returns:
            the reference without directories, as a run's configuration keeps it.

        Raises:
            InputError: there is no such file or name in it, or it fails; its error is the cause.
        """
        path, _, own = reference.rpartition(":")
        file = Path(path).absolute()
        module = sys.modules.get(f"hyuav_own_{file.stem}") or self._run(path)
        if module.__file__ != str(file):
            accepted = f"files of different names, but there is {module.__file__} too"
            raise InputError(rejection(self.field, reference, accepted))
        name = f"{file.name}:{own}"
        self[name] = self._accept(reference, getattr(module, own, None), f"{file}:{own}")
        return name

    def _run(self, path: str) -> ModuleType:
        file = Path(path).absolute()
        name = f"hyuav_own_{file.stem}"
        spec = importlib.util.spec_from_file_location(name, file)
        runs = file.is_file() and file.stem.isidentifier()
        if spec is None or spec.loader is None or not runs:
            raise InputError(rejection(self.field, path, "a Python file"))
        module = importlib.util.module_from_spec(spec)
        sys.modules[name] = module  # where dataclasses and pickle look for it
        try:
            spec.loader.exec_module(module)
        except BaseException as error:  # whichever the file raises
            del sys.modules[name]
            accepted = f"a Python file that runs ({failure(error, file)})"
            raise InputError(rejection(self.field, path, accepted)) from error
        return module


def file_name(name: str) -> str:
    """A name as directories bear it."""
    return name.replace(".py:", "_")


def is_reference(name: str) -> bool:
    """Whether a name tells what a Python file holds."""
    return re.fullmatch(r".*\.py:\w+", name, re.DOTALL) is not None


def failure(error: BaseException, file: Path) -> str:
    """What went wrong, and in which file and line; the path may be too long to be shown whole."""
    frames = traceback.extract_tb(error.__traceback__)
    lines = [frame.lineno for frame in frames if frame.filename == str(file)]
    line = f", line {lines[-1]}" if lines else ""
    return one_line(f"{file.name}{line}: {type(error).__name__}: {error}")
