"""Reading YAML that somebody sent: plain values, no larger and no deeper than they look."""

from io import StringIO
from pathlib import Path
from typing import Any

import yaml
from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException
from yaml import YAMLError

from hyuav._support.errors import InputError, one_line

YAML_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
"""Knows plain values alone; deep nesting would crash the fast one, were it not looked for first."""

LARGEST_YAML = 2**22
"""Bytes of a file that is read; the positions of a hundred thousand UEs take fewer."""

LONGEST_YAML = 3000
"""Characters of a value; Python writes no number with many more digits."""

DEEPEST_YAML = 20
"""Lists and mappings within each other; configurations have five."""


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
