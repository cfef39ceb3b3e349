"""Immutable records of parameters that check themselves and speak in one line."""

import dataclasses
import difflib
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Any, Self

import numpy as np
import yaml
from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException
from yaml import YAMLError

from hyuav._support.errors import (
    InputError,
    InputTypeError,
    brief,
    one_line,
    rejection,
    require_choice,
)

YAML_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
"""Knows plain values alone; deep nesting would crash the fast one, were it not looked for first."""

LARGEST_YAML = 2**22
"""Bytes of a file that is read; the positions of a hundred thousand UEs take fewer."""

LONGEST_YAML = 3000
"""Characters of a value; Python writes no number with many more digits."""

DEEPEST_YAML = 20
"""Lists and mappings within each other; configurations have five."""

MOST_THREADS = 1024
"""More than any machine has use for, and few enough to be started."""

Converter = Callable[[str, Any], Any]
"""Takes a field's name and a value; returns the value as it is kept, or raises InputError."""


def number(
    low: float = -math.inf,
    high: float = math.inf,
    *,
    above: float | None = None,
) -> Converter:
    """Accept finite numbers in [low, high], or above ``above``."""
    accepted = "a finite number"
    if above is not None:
        accepted += f" > {above:g}"
    elif math.isfinite(low) and math.isfinite(high):
        accepted = f"a number in [{low:g}, {high:g}]"
    elif math.isfinite(low):
        accepted += f" >= {low:g}"

    def convert(name: str, value: Any) -> float:
        refused = isinstance(value, bool | np.bool_ | complex | np.complexfloating | str | bytes)
        if refused or not hasattr(value, "__float__"):
            raise InputTypeError(rejection(name, value, accepted))
        try:
            result = float(value)
        except (TypeError, ValueError, RuntimeError, OverflowError):
            raise InputTypeError(rejection(name, value, accepted)) from None
        inside = low <= result <= high and (above is None or result > above)
        if not (math.isfinite(result) and inside):
            raise InputError(rejection(name, value, accepted))
        return result

    return convert


def count(low: int = 1, high: int = 2**63 - 1) -> Converter:
    """Accept whole numbers in [low, high]; the highest possible is what an int64 holds."""
    accepted = f"a whole number >= {low}"

    def convert(name: str, value: Any) -> int:
        if isinstance(value, bool) or not hasattr(value, "__index__"):
            raise InputTypeError(rejection(name, value, accepted))
        try:
            result = int(value.__index__())
        except TypeError:
            raise InputTypeError(rejection(name, value, accepted)) from None
        if result < low:
            raise InputError(rejection(name, value, accepted))
        if result > high:
            raise InputError(rejection(name, value, f"a whole number <= {high}"))
        return result

    return convert


thread_count = count(1, MOST_THREADS)
"""Accept how many threads or processes work at the same time."""


def switch(name: str, value: Any) -> bool:
    """Accept true and false."""
    if not isinstance(value, bool):
        raise InputTypeError(rejection(name, value, "true or false"))
    return value


def choice(*choices: str) -> Converter:
    """Accept one of ``choices``."""

    def convert(name: str, value: Any) -> str:
        require_choice(name, value, choices)
        return str(value)

    return convert


def text(name: str, value: Any) -> str:
    """Accept text that is not empty."""
    if not isinstance(value, str):
        raise InputTypeError(rejection(name, value, "text"))
    if not value.strip():
        raise InputError(rejection(name, value, "text that is not empty"))
    return value


def optional(convert: Converter) -> Converter:
    """Accept None, and what ``convert`` accepts."""

    def convert_or_none(name: str, value: Any) -> Any:
        return None if value is None else convert(name, value)

    return convert_or_none


def one_or_more(element: Converter, accepted: str) -> Converter:
    """Accept one value or a list of them; keep a tuple."""
    several = sequence(element, accepted)

    def convert(name: str, value: Any) -> tuple[Any, ...]:
        if isinstance(value, list | tuple):
            return several(name, value)
        return (element(name, value),)

    return convert


def sequence(element: Converter, accepted: str, *, length: int | None = None) -> Converter:
    """Accept lists, tuples, arrays and tensors of at least one element; keep them as tuples."""

    def convert(name: str, value: Any) -> tuple[Any, ...]:
        items = value.tolist() if hasattr(value, "tolist") else value
        if not isinstance(items, list | tuple):
            raise InputTypeError(rejection(name, value, accepted))
        if not items or (length is not None and len(items) != length):
            raise InputError(rejection(name, value, accepted))
        return tuple(element(f"{name}[{index}]", item) for index, item in enumerate(items))

    return convert


def record(kind: type["Parameters"]) -> Converter:
    """Accept a record of this kind, or its fields by name."""

    def convert(name: str, value: Any) -> "Parameters":
        if isinstance(value, kind):
            return value
        try:
            return kind.from_dict(mapping(name, value))
        except InputError as error:
            prefix = "" if str(error).startswith(name) else f"{name}."
            raise type(error)(f"{prefix}{error}") from None

    return convert


def increasing_pair(low: float, high: float = math.inf) -> Converter:
    """Accept two numbers (first, last) with low <= first <= last <= high."""
    accepted = f"two numbers (low, high) with {low:g} <= low <= high"
    pair = sequence(number(low, high), accepted, length=2)

    def convert(name: str, value: Any) -> tuple[float, float]:
        first, last = pair(name, value)
        if first > last:
            raise InputError(rejection(name, value, accepted))
        return first, last

    return convert


def parameter(
    convert: Converter, default: Any = dataclasses.MISSING, *, symbol: str = "", unit: str = ""
) -> Any:
    """Declare a field of :class:`Parameters`: its check, default, paper symbol and unit."""
    metadata = {"convert": convert, "symbol": symbol, "unit": unit}
    return dataclasses.field(default=default, metadata=metadata)


def refuse_unknown(owner: str, names: Iterable[str], known: Iterable[str]) -> None:
    """Accept only names that are known.

    Raises:
        InputError: naming the unknown one and the most similar known one.
    """
    known = list(known)
    for name in names:
        if name not in known:
            similar = difflib.get_close_matches(str(name)[:80], known, n=1)
            hint = f"did you mean {similar[0]!r}?" if similar else f"one of {', '.join(known)}"
            raise InputError(f"{owner}: unknown field {brief(name)}: {hint}")


def mapping(name: str, value: object) -> dict[str, Any]:
    """Accept names with values.

    Raises:
        InputTypeError: it is something else.
    """
    if not isinstance(value, Mapping):
        raise InputTypeError(rejection(name, value, "names with values"))
    return {str(key): entry for key, entry in value.items()}


def require_plain_yaml(path: Path) -> str:
    """The text of a YAML file whose content is no larger and no deeper than it looks.

    An alias could make a few lines into gigabytes, and brackets in brackets could exhaust the
    stack of a parser.

    Raises:
        InputError: it is no file, too large, too deep, or has aliases; the message is the reason.
        OSError: it cannot be read.
        YAMLError: it is not YAML.
    """
    if path.exists() and not path.is_file():
        raise InputError("cannot be read (not a file)")
    with path.open("rb") as file:
        content = file.read(LARGEST_YAML + 1)
    if len(content) > LARGEST_YAML:
        raise InputError(f"cannot be read (larger than {LARGEST_YAML} bytes)")
    text, depth = content.decode("utf-8"), 0
    for event in yaml.parse(text, YAML_LOADER):
        if isinstance(event, yaml.AliasEvent):
            raise InputError("cannot be read (it has aliases)")
        if isinstance(event, yaml.ScalarEvent) and len(event.value) > LONGEST_YAML:
            raise InputError(f"cannot be read (a value of more than {LONGEST_YAML} characters)")
        depth += isinstance(event, yaml.CollectionStartEvent)
        depth -= isinstance(event, yaml.CollectionEndEvent)
        if depth > DEEPEST_YAML:
            raise InputError(f"cannot be read (nested more than {DEEPEST_YAML} times)")
    return text


def read_yaml(path: str | Path) -> dict[str, Any]:
    """Read names with values from a YAML file; nothing in it is run or looked up.

    Raises:
        InputError: no such file, not YAML, or not names with values; the message is the reason.
    """
    try:
        content = require_plain_yaml(Path(path))
        values = OmegaConf.to_container(OmegaConf.load(StringIO(content)), resolve=False)
    except (OSError, YAMLError, OmegaConfBaseException, ValueError, RecursionError) as error:
        if isinstance(error, InputError):
            raise
        reason = one_line(str(error))[:200]
        raise InputError(f"cannot be read ({reason})") from None
    if not isinstance(values, dict):
        raise InputError("expected fields with values")
    return {str(name): value for name, value in values.items()}


@dataclass(frozen=True)
class Parameters:
    """A record whose fields, declared with :func:`parameter`, are checked on creation.

    Raises:
        InputError: (a ``ValueError``) a value out of its range.
        InputTypeError: (also a ``TypeError``) a value of the wrong type.
    """

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            converted = field.metadata["convert"](field.name, getattr(self, field.name))
            object.__setattr__(self, field.name, converted)

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Self:
        """Build the record from plain values, such as a parsed YAML file or command line.

        Raises:
            InputError: no names with values, or an unknown, missing or unacceptable field.
        """
        owner = cls.__name__.lower()
        mapping(owner, values)
        fields = dataclasses.fields(cls)
        refuse_unknown(owner, values, [field.name for field in fields])
        for field in fields:
            if field.default is dataclasses.MISSING and field.name not in values:
                raise InputError(f"{owner}: {field.name} is missing")
        return cls(**values)

    def to_dict(self) -> dict[str, Any]:
        """Plain values (numbers, strings, lists, dicts), as :meth:`from_dict` takes them."""
        return {field.name: _plain(getattr(self, field.name)) for field in dataclasses.fields(self)}

    def save(self, path: str | Path) -> None:
        """Write the record as YAML."""
        OmegaConf.save(OmegaConf.create(self.to_dict()), path)

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a record from a YAML file that :meth:`save` or a person wrote.

        Raises:
            InputError: no such file, not YAML, or not such a record.
        """
        try:
            return cls.from_dict(read_yaml(path))
        except InputError as error:
            raise InputError(f"{cls.__name__.lower()} file {str(path)!r}: {error}") from None


def _plain(value: Any) -> Any:
    if isinstance(value, tuple):
        return [_plain(item) for item in value]
    return value.to_dict() if isinstance(value, Parameters) else value
