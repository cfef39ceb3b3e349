"""What the pages tell of parameters is what the program does by default."""

import re
from pathlib import Path

from hyuav import Guide

ROBUST = Path(__file__).parents[2] / "docs" / "robust-variant.md"


def test_the_posterior_is_as_wide_as_it_was_for_the_results() -> None:
    told = re.search(r"`guide\.posterior_scale`, (\d+)", ROBUST.read_text(encoding="utf-8"))
    assert told is not None
    assert Guide().posterior_scale == float(told[1])
