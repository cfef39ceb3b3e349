"""Training a generalist as a user calls for it, as small as it can be."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from hyuav.experiments import generalist
from hyuav.learning.checkpoint import save_checkpoint
from recipe_calls import Call, Refusal

Printed = pytest.CaptureFixture[str]

TINY = (
    *("generalist", "output=here", "workers=1", "threads=1", "scenarios=6", "validation=2"),
    *("learning.steps=6", "learning.batch_size=16", "learning.evaluation_every=3"),
)


def test_it_is_trained_kept_and_continued(
    call: Call, tmp_path: Path, capsys: Printed, monkeypatch: pytest.MonkeyPatch
) -> None:
    call(*TINY)
    printed, here = capsys.readouterr().out, tmp_path / "here"
    assert "of the optimum in scenarios for validation: " in printed
    progress = pd.read_csv(here / "progress.csv")
    assert progress["step"].tolist() == [3, 6]
    with np.load(here / "generalist.npz", allow_pickle=False) as arrays:
        whole = {name: arrays[name] for name in arrays.files}
    # The same, interrupted after the first evaluation.
    kept: list[Path] = []

    def save_once(path: Path, kind: str, content: dict[str, object]) -> None:
        save_checkpoint(path, kind, content)
        if kind == "generalist":
            kept.append(path)
            if len(kept) == 1:
                raise KeyboardInterrupt

    monkeypatch.setattr(generalist, "save_checkpoint", save_once)
    again = tuple(part.replace("output=here", "output=there") for part in TINY)
    with pytest.raises(SystemExit):
        call(*again)
    assert "go on with: " in capsys.readouterr().err
    call(*again)
    with np.load(tmp_path / "there" / "generalist.npz", allow_pickle=False) as arrays:
        for name, own in whole.items():
            np.testing.assert_array_equal(arrays[name], own)


def test_another_training_is_refused(call: Call, refusal: Refusal) -> None:
    small = (*TINY[:4], "scenarios=1", "validation=1", "learning.steps=1")
    call(*small)
    line = refusal(*small[:-1], "learning.steps=2")
    assert "expected a generalist with learning.steps = 2 (there it is 1)" in line
