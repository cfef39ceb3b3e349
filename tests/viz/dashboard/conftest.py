"""The dashboard's pages, which Streamlit runs as programs."""

import sys

import pytest


@pytest.fixture(autouse=True)
def the_same_program(monkeypatch: pytest.MonkeyPatch) -> None:
    """Put back the main module, in whose place Streamlit's tests leave a page's.

    Processes that are started later would run that page.
    """
    monkeypatch.setitem(sys.modules, "__main__", sys.modules["__main__"])
