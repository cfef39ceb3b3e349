"""What the pages share: text of unknown origin that stays text, refusals, and choices."""

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import streamlit as st

from hyuav._support.errors import InputError

_MARKED = re.compile(r"([\\`*_{}\[\]()#+\-.!|<>~$:&@/\"'])")


def plain(text: object) -> str:
    """Markdown that shows the text itself on one line, no link, picture or formula."""
    return _MARKED.sub(r"\\\1", " ".join(str(text).split()))


@contextmanager
def refusals() -> Iterator[None]:
    """Show what a person can mend as one line, and go on after the block."""
    try:
        yield
    except InputError as error:
        st.error(plain(error))


def ensure_offered(key: str, options: Sequence[Any]) -> None:
    """Choose the first option where what a widget holds is not, or no longer, offered."""
    if st.session_state.get(key) not in options:
        st.session_state[key] = options[0]
