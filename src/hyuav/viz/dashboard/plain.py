"""Text of unknown origin on a page: shown as it is, never as a link, a picture or a formula."""

import re
from collections.abc import Iterator
from contextlib import contextmanager

import streamlit as st

from hyuav._support.errors import InputError

_MARKED = re.compile(r"([\\`*_{}\[\]()#+\-.!|<>~$:&@/\"'])")


def plain(text: object) -> str:
    """Markdown that shows the text itself, on one line."""
    return _MARKED.sub(r"\\\1", " ".join(str(text).split()))


@contextmanager
def refusals() -> Iterator[None]:
    """Show what a person can mend as one line, and go on after the block."""
    try:
        yield
    except InputError as error:
        st.error(plain(error))
