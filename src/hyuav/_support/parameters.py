"""Immutable records of parameters: dataclasses of pydantic, answered in one line."""

import dataclasses
import functools
import typing
from abc import ABCMeta
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self, TypeVar

from omegaconf import OmegaConf
from pydantic import (
    AfterValidator,
    BeforeValidator,
    ConfigDict,
    Field,
    GetCoreSchemaHandler,
    TypeAdapter,
    ValidationError,
)
from pydantic.dataclasses import dataclass, is_pydantic_dataclass
from pydantic.fields import FieldInfo

from hyuav._support.errors import InputError, InputTypeError, brief, did_you_mean, rejection
from hyuav._support.yaml_files import read_yaml

LARGEST_COUNT = 2**63 - 1
"""What an int64 holds."""

MOST_THREADS = 1024
"""More than any machine has use for, and few enough to be started."""

DEEPEST = 3
"""Lists and mappings within each other; positions are two deep."""

SCALARS = frozenset((bool, float, int, str, type(None)))
"""Python's own."""

STRICT = ConfigDict(strict=True, allow_inf_nan=False, extra="forbid", validate_default=True)
"""Nothing is taken for what it is not: no text for a number, no number for a truth value."""


Element = TypeVar("Element")


class OneOf:
    """Annotates text that is one of ``choices``."""

    def __init__(self, *choices: str) -> None:
        self.choices = choices

    def __get_pydantic_core_schema__(self, _: Any, handler: GetCoreSchemaHandler) -> Any:
        """What pydantic asks an annotation for."""
        return handler.generate_schema(Literal[self.choices])


def _require_content(text: str) -> str:
    if not text.strip():
        raise ValueError
    return text


OrOne = BeforeValidator(lambda value: value if isinstance(value, tuple) else (value,))
"""Annotates a tuple for which a single element may stand."""

Number = Annotated[float, Field()]
PositiveNumber = Annotated[float, Field(gt=0.0)]
NonNegativeNumber = Annotated[float, Field(ge=0.0)]
Fraction = Annotated[float, Field(ge=0.0, le=1.0)]
Count = Annotated[int, Field(ge=1, le=LARGEST_COUNT)]
CountOrZero = Annotated[int, Field(ge=0, le=LARGEST_COUNT)]
Threads = Annotated[int, Field(ge=1, le=MOST_THREADS)]
"""How many threads or processes work at the same time."""
Text = Annotated[str, AfterValidator(_require_content)]
ZeroOrMore = Annotated[tuple[Element, ...], OrOne]
OneOrMore = Annotated[tuple[Element, ...], OrOne, Field(min_length=1)]


def parameter(
    default: Any = dataclasses.MISSING,
    *,
    factory: Any = dataclasses.MISSING,
    symbol: str = "",
    unit: str = "",
) -> Any:
    """Declare a field of :class:`Parameters`: its default, or what finds it, symbol and unit."""
    metadata = {"symbol": symbol, "unit": unit}
    if factory is not dataclasses.MISSING:
        return dataclasses.field(default_factory=factory, metadata=metadata)
    return dataclasses.field(default=default, metadata=metadata)


def checked(annotation: Any, name: str, value: Any) -> Any:
    """A value as a field of an annotated type keeps it.

    Args:
        annotation: the type, such as :data:`Count`.
        name: that an error begins with.
        value: to be checked.

    Raises:
        InputError: (a ``ValueError``) a value out of its range.
        InputTypeError: (also a ``TypeError``) a value of the wrong type.
    """
    try:
        return _adapter(annotation).validate_python(plain(value))
    except ValidationError as error:
        raise _in_one_line(error, annotation, value, name) from None


def accepted(annotation: Any) -> str:
    """What an annotated type accepts, in words."""
    info = declared(annotation)
    kind: Any = info.annotation
    if info.description:
        return info.description
    if choices := _choices(annotation):
        return f"one of {', '.join(choices)}"
    if typing.get_origin(kind) is tuple:
        element = typing.get_args(kind)[0]
        return f"a list of {', '.join(_choices(element)) or accepted(element)}"
    if kind not in (int, float):
        words = {bool: "true or false", str: "text that is not empty"}
        return words.get(kind, "names with values")
    bounds: dict[str, float] = {}
    for bound in info.metadata:
        bounds |= dataclasses.asdict(bound)
    if kind is int:
        return f"a whole number >= {bounds['ge']}"
    if "le" in bounds:
        return f"a number in [{bounds['ge']:g}, {bounds['le']:g}]"
    if "gt" in bounds:
        return f"a finite number > {bounds['gt']:g}"
    return f"a finite number >= {bounds['ge']:g}" if "ge" in bounds else "a finite number"


def _choices(annotation: Any) -> tuple[str, ...]:
    metadata = declared(annotation).metadata
    return next((check.choices for check in metadata if isinstance(check, OneOf)), ())


def refuse_unknown(owner: str, names: Iterable[object], known: Iterable[str]) -> None:
    """Accept only names that are known.

    Raises:
        InputError: naming the unknown one and the most similar known one.
    """
    known = list(known)
    for name in names:
        if name not in known:
            raise unknown_field(owner, name, known)


def unknown_field(owner: str, name: object, known: Iterable[str]) -> InputError:
    """The refusal of a name, with the most similar known one or else all of them."""
    hint = did_you_mean(str(name)[:80], known).strip(" ()") or f"one of {', '.join(known)}"
    return InputError(f"{owner}: unknown field {brief(name)}: {hint}")


def mapping(name: str, value: object) -> dict[str, Any]:
    """Accept names with values.

    Raises:
        InputTypeError: it is something else.
    """
    if not isinstance(value, Mapping):
        raise InputTypeError(rejection(name, value, "names with values"))
    return {str(key): entry for key, entry in value.items()}


def require_record(name: str, value: object, kind: type) -> None:
    """Accept a record of this kind.

    Raises:
        InputTypeError: it is something else.
    """
    if not isinstance(value, kind):
        raise InputTypeError(rejection(name, value, f"{kind.__name__}(...)"))


class _InOneLine(ABCMeta):
    """Creates records, and answers what they do not accept in one line."""

    def __call__(cls, /, *values: Any, **named: Any) -> Any:
        if not is_pydantic_dataclass(cls):
            raise TypeError(f"{cls.__name__} is to be a dataclass of pydantic.dataclasses")
        try:
            return super().__call__(*map(plain, values), **plain(named))
        except ValidationError as error:
            given = dict(zip(_hints(cls), values, strict=False)) | named
            raise _in_one_line(error, cls, given) from None


@dataclass(frozen=True)
class Parameters(metaclass=_InOneLine):
    """A record that checks its fields on creation: a frozen dataclass of pydantic.

    Every field has an annotated type, such as :data:`Count`, and is declared by
    :func:`parameter`; it may be such a record itself. Lists, ranges, arrays and tensors are taken
    for tuples, NumPy's numbers for Python's.

    Raises:
        InputError: (a ``ValueError``) a value out of its range.
        InputTypeError: (also a ``TypeError``) a value of the wrong type.
    """

    __pydantic_config__: ClassVar[ConfigDict] = STRICT

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: GetCoreSchemaHandler) -> Any:
        """What pydantic asks a field's type for: names with values are taken for a record."""
        return {**handler(source), "strict": False}

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Self:
        """Build the record from plain values, such as a parsed YAML file or command line.

        Raises:
            InputError: no names with values, or an unknown, missing or unacceptable field.
        """
        return cls(**mapping(cls.__name__.lower(), values))

    @classmethod
    def defaults(cls) -> dict[str, Any]:
        """The plain default of each field, unchecked; those that have none are left out."""
        values = {}
        for field in dataclasses.fields(cls):
            if field.default_factory is not dataclasses.MISSING:
                values[field.name] = _as_lists(field.default_factory())
            elif field.default is not dataclasses.MISSING:
                values[field.name] = _as_lists(field.default)
        return values

    def to_dict(self) -> dict[str, Any]:
        """Plain values (numbers, strings, lists, mappings), as :meth:`from_dict` takes them."""
        return {
            field.name: _as_lists(getattr(self, field.name)) for field in dataclasses.fields(self)
        }

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


def _as_lists(value: Any) -> Any:
    if isinstance(value, Parameters):
        return value.to_dict()
    if isinstance(value, Mapping):
        return {name: _as_lists(entry) for name, entry in value.items()}
    return [_as_lists(item) for item in value] if isinstance(value, tuple) else value


def plain(value: Any, depth: int = DEEPEST) -> Any:
    """What a person may give for numbers or texts, in Python's own types.

    Lists, ranges, arrays and tensors become tuples, NumPy's numbers Python's, also in mappings.
    What is none of these is left as it is.
    """
    if type(value) in SCALARS:
        return value
    try:
        value = value.tolist() if hasattr(value, "tolist") else value
    except (TypeError, ValueError, RuntimeError):  # a tensor without content
        return value
    if isinstance(value, list | tuple | range) and depth:
        return tuple(plain(item, depth - 1) for item in value)
    if isinstance(value, Mapping) and depth:
        return {name: plain(entry, depth - 1) for name, entry in value.items()}
    return value


@functools.lru_cache(maxsize=128)
def _adapter(annotation: Any) -> TypeAdapter[Any]:
    return TypeAdapter(annotation, config=STRICT)


@functools.cache
def _hints(owner: type[Parameters]) -> dict[str, Any]:
    """The fields of a record and their annotated types."""
    hints = typing.get_type_hints(owner, include_extras=True)
    return {field.name: hints[field.name] for field in dataclasses.fields(owner)}


def declared(annotation: Any) -> FieldInfo:
    """An annotated type and what is checked of it, where it is not None."""
    info = FieldInfo.from_annotation(annotation)
    kinds = typing.get_args(info.annotation)
    return declared(kinds[0]) if type(None) in kinds else info


def _in_one_line(error: ValidationError, annotation: Any, value: Any, name: str = "") -> InputError:
    """What pydantic finds wrong at first, in this project's words.

    Args:
        error: of pydantic.
        annotation: the type that was expected.
        value: that was given.
        name: of the value; none where it is a record, whose fields are named.
    """
    first = error.errors(include_url=False)[0]
    kind, context = first["type"], first.get("ctx", {})
    place: tuple[Any, ...] = first["loc"]
    for part in place:
        expected: Any = declared(annotation).annotation
        if isinstance(expected, _InOneLine):
            owner, hints = name or expected.__name__.lower(), _hints(expected)
            part = list(hints)[part] if isinstance(part, int) and part < len(hints) else part
            name = f"{name}.{part}" if name else str(part)
            if refusal := _of_names(kind, owner, part, hints, value):
                return refusal
            annotation, value = hints[part], value.get(part, first["input"])  # or the default
        elif kind != "missing":  # or the tuple as a whole is too short
            elements = typing.get_args(expected)
            annotation = elements[0 if elements[-1] is ... else part]
            if isinstance(plain(value), tuple):  # else a single element stands for it
                name, value = f"{name}[{part}]", plain(value)[part]
    if isinstance(own := context.get("error"), InputError):  # which a record raised itself
        return type(own)(f"{name}.{own}") if name else own
    words = accepted(annotation)
    if kind == "literal_error":
        words += did_you_mean(value, _choices(annotation))
    if kind == "less_than_equal" and isinstance(context["le"], int):
        words = f"a whole number <= {context['le']}"
    line = rejection(name, value, words)
    return InputTypeError(line) if kind.endswith("_type") else InputError(line)


def _of_names(
    kind: str, owner: str, name: Any, known: Iterable[str], given: Mapping[str, Any]
) -> InputError | None:
    """The answer to a field of a record that is unknown, missing or given twice."""
    if kind in ("unexpected_positional_argument", "multiple_argument_values"):
        return InputTypeError(f"{owner}: {kind.replace('_', ' ')}: {brief(name)}")
    if name not in known:
        return unknown_field(owner, name, known)
    missing = kind == "missing" and name not in given
    return InputTypeError(f"{owner}: {name} is missing") if missing else None
