"""Nothing that is computed changes by a single bit; see :mod:`golden.measure`."""

import json
from collections.abc import Iterator
from typing import Any

import pytest

from golden.measure import GOLDEN, PARTS, arithmetic, measure

KEPT = json.loads(GOLDEN.read_text())
SLOW = ("compiled_trainings", "job")
NAMES = [pytest.param(name, marks=pytest.mark.slow if name in SLOW else ()) for name in PARTS]


def differences(kept: Any, measured: Any, place: str = "") -> Iterator[str]:
    """Where measured numbers are not those that were kept.

    What has another name now is found by its content, among what is told beside it. Weights may
    be anywhere in a training's state, and what is told in parts need not be told as a whole.
    """
    if isinstance(kept, list) and isinstance(measured, list) and len(kept) == len(measured):
        for index, (value, found) in enumerate(zip(kept, measured, strict=True)):
            yield from differences(value, found, f"{place} {index}")
        return
    if not isinstance(kept, dict) or not isinstance(measured, dict):
        if kept != measured:
            yield f"{place}: {kept} became {measured}"
        return
    for name, value in kept.items():
        here, beside = f"{place} / {name}", measured.values()
        if name == "state":
            found = measured[name].values()
            yield from (f"{here}{path}: gone" for path, own in value.items() if own not in found)
        elif name in measured:
            yield from differences(value, measured[name], here)
        elif value not in beside and not any(other.startswith(f"{name}.") for other in measured):
            yield f"{here}: gone"


@pytest.mark.parametrize("name", NAMES)
def test_every_number_is_what_it_was(name: str) -> None:
    if arithmetic() != KEPT["arithmetic"]:
        pytest.skip("this CPU or this PyTorch rounds otherwise than where the numbers were kept")
    changed = list(differences(KEPT[name], measure(name)))
    assert not changed, "\n".join([f"{len(changed)} numbers", *changed[:20]])
