"""Text on the command line, as Hydra takes it."""

import re
from pathlib import Path


def in_quotes(text: str) -> str:
    """Text in quotation marks, from which Hydra reads just this text, whatever is in it."""
    nothing_looked_up = re.sub(r"(\\*)\$\{", r"\1\1\\${", text)
    escaped = re.sub(r'(\\*)"', r'\1\1\\"', nothing_looked_up)
    backslashes = len(escaped) - len(escaped.rstrip("\\"))
    return f'"{escaped}{escaped[len(escaped) - backslashes :]}"'


def override(name: str, path: Path) -> str:
    """What sets an entry to a path on the command line, in quotation marks where it needs them.

    Args:
        name: of the entry.
        path: told from the working directory if it is below.
    """
    absolute = path.absolute()
    below = absolute.is_relative_to(Path.cwd())
    value = str(absolute.relative_to(Path.cwd()) if below else absolute)
    is_plain = re.fullmatch(r"[A-Za-z./_][\w./:+-]*/[\w./:+-]*", value, re.ASCII)
    return f"{name}={value if is_plain else in_quotes(value)}"
