"""The errors and warnings a user can cause, each told in one line."""

import difflib
from collections.abc import Iterable


class InputError(ValueError):
    """A value that is not accepted; the message names the field, the value and what is accepted."""


class InputTypeError(InputError, TypeError):
    """A value of a type that is not accepted."""


class BusyError(InputError):
    """A place where another process works."""


class ScenarioWarning(UserWarning):
    """Something can never be earned in a scenario; the message says in one line why."""


class Interrupted(KeyboardInterrupt):
    """A signal asked to stop; the message says in one line how far it came.

    Args:
        message: the line.
        signal: its number.
    """

    def __init__(self, message: str, signal: int) -> None:
        super().__init__(message, signal)
        self.signal = signal

    def __str__(self) -> str:
        return str(self.args[0])


class Halted(Exception):  # noqa: N818 - nothing was wrong with what was asked for
    """A training cannot go on, for want of space perhaps; the message is one line.

    Args:
        message: the line.
        resumable: whether it can go on when the cause has been removed.
    """

    def __init__(self, message: str, *, resumable: bool = True) -> None:
        super().__init__(message)
        self.resumable = resumable


def harmless(text: str) -> str:
    """Text of unknown origin without characters that a terminal would obey, line breaks too."""
    return "".join(own if own.isprintable() else "?" for own in text)


def one_line(text: str) -> str:
    """The same on one line, its words a blank apart."""
    return harmless(" ".join(text.split()))


def brief(value: object) -> str:
    """A value on one line, shortened, without characters that a terminal would obey."""
    try:
        shown = " ".join(repr(value).split())
    except (ValueError, RecursionError):  # a whole number of thousands of digits, or no end
        shown = f"a {type(value).__name__} too large to show"
    return shown if len(shown) <= 80 else f"{shown[:77]}..."


def cause(error: OSError) -> str:
    """Why the system refused, behind the file's name where it is known."""
    reason = error.strerror or str(error)
    return f"{error.filename}: {reason}" if error.filename else reason


def rejection(name: str, value: object, accepted: str) -> str:
    """The one line that answers bad input: field, value (shortened), what is accepted."""
    return f"{name} = {brief(value)}: expected {accepted}"


def most_similar(value: object, choices: Iterable[str]) -> str | None:
    """The choice that a value may have been meant for; None where none is much like it."""
    if not isinstance(value, str):
        return None
    by_letters = {choice.lower(): choice for choice in choices}
    similar = difflib.get_close_matches(value[:80].lower(), by_letters, n=1, cutoff=0.7)
    return by_letters[similar[0]] if similar else None


def did_you_mean(value: object, choices: Iterable[str]) -> str:
    """A hint at the most similar choice, to be put behind a line; empty if there is none."""
    similar = most_similar(value, choices)
    return f" (did you mean {similar!r}?)" if similar else ""


def require_choice(name: str, value: object, choices: Iterable[str]) -> None:
    """Accept ``value`` only where it is one of ``choices``.

    Raises:
        InputError: naming the choices, the most similar one first if there is one.
    """
    choices = list(choices)
    if not isinstance(value, str) or value not in choices:
        hint = did_you_mean(value, choices)
        raise InputError(rejection(name, value, f"one of {', '.join(choices)}{hint}"))
