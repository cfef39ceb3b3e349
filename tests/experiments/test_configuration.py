"""What a recipe says of its own call; its refusals are tested with the recipes."""

import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from hydra.core.hydra_config import HydraConfig
from hydra.types import RunMode

from hyuav.experiments import command_line
from hyuav.experiments.command_line import same_call


@pytest.mark.parametrize(
    ("mode", "others"), [(RunMode.RUN, ["-q", "seed=0,1"]), (RunMode.MULTIRUN, ["seed=1"])]
)
def test_a_job_goes_on_by_its_own_call_also_where_it_was_one_of_several(
    monkeypatch: pytest.MonkeyPatch, mode: RunMode, others: list[str]
) -> None:
    overrides = SimpleNamespace(task=["seed=1", "output=elsewhere"])
    monkeypatch.setattr(HydraConfig, "get", lambda: SimpleNamespace(mode=mode, overrides=overrides))
    monkeypatch.setattr(sys, "argv", ["compare.py", "-q", "seed=0,1", "output=elsewhere"])
    command_line.remember()
    assert same_call("output", Path("runs/1")) == [*others, "output=runs/1"]
