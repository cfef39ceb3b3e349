"""Libraries are loaded with the garbage collector nearly at rest."""

import gc
import sys
from pathlib import Path

import pytest

from hyuav._support.loading import SELDOM, collect_as_ever, load_quietly


@pytest.mark.parametrize("end", ["", "raise ImportError"])
def test_garbage_is_sought_seldom_until_a_library_is_loaded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, end: str
) -> None:
    name = f"slow_to_load{len(end)}"
    (tmp_path / f"{name}.py").write_text(f"import gc, sys\nsys.seen = gc.get_threshold()\n{end}\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "seen", None, raising=False)
    collect_as_ever()
    before = gc.get_threshold()
    try:
        load_quietly(name)
    except ImportError:
        assert end
    assert sys.seen == SELDOM  # type: ignore[attr-defined]
    assert gc.get_threshold() == before != SELDOM
