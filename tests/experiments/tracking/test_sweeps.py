"""The sweep definitions, as an agent of Weights & Biases reads them and calls what they say."""

import math
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from omegaconf import OmegaConf
from wandb.sdk.launch.sweeps.utils import (
    create_sweep_command,
    create_sweep_command_args,
    load_sweep_config,
)

from hyuav._support.parameters import mapping
from hyuav.experiments.run_directory import RunDirectory
from hyuav.learning.registry import ALGORITHMS
from offline_wandb import offline_runs, recorded, summary
from recipe_calls import TINY

ROOT = Path(__file__).parents[3]
SWEEPS = sorted((ROOT / "sweeps").glob("*.yaml"))
SHORT = [*TINY, "scenario.num_slots=4", "learners=1", "logger.mode=offline"]

FIELDS = {
    "uniform": {"min", "max"},
    "log_uniform_values": {"min", "max"},
    None: {"values"},
}
"""What W&B's schema asks for beside each distribution's name."""


def read(file: Path) -> dict[str, Any]:
    config = load_sweep_config(str(file))
    assert config is not None
    return config


def draw(parameter: dict[str, Any], rng: np.random.Generator) -> Any:
    """A value as W&B would draw it."""
    if "values" in parameter:
        return parameter["values"][rng.integers(len(parameter["values"]))]
    low, high = parameter["min"], parameter["max"]
    if parameter["distribution"] == "uniform":
        return float(rng.uniform(low, high))
    return float(np.exp(rng.uniform(math.log(low), math.log(high))))


def command(config: dict[str, Any], rng: np.random.Generator) -> list[str]:
    """What an agent would run, by its own functions."""
    drawn = {name: {"value": draw(own, rng)} for name, own in config["parameters"].items()}
    parts = create_sweep_command_args({"args": drawn})
    parts |= {"interpreter": [sys.executable], "program": [config["program"]], "env": []}
    return [
        word
        for piece in create_sweep_command(list(config["command"]))
        for word in (parts[piece[2:-1]] if piece.startswith("${") else [piece])
    ]


@pytest.mark.parametrize("file", SWEEPS, ids=lambda file: file.stem)
def test_a_sweep_is_defined_as_weights_and_biases_asks_for(file: Path) -> None:
    config = read(file)
    assert {"method", "metric", "parameters", "program", "command"} <= set(config)
    assert config["method"] in {"bayes", "random", "grid"}
    assert config["metric"] == {"name": "best_evaluation", "goal": "maximize"}
    for own in config["parameters"].values():
        assert set(own) - {"distribution"} == FIELDS[own.get("distribution")]
        if "min" in own:
            assert own["max"] - own["min"] > 0
            assert all(isinstance(own[bound], float) for bound in ("min", "max"))  # not "1e-5"


@pytest.mark.parametrize("file", SWEEPS, ids=lambda file: file.stem)
def test_all_that_a_sweep_draws_is_accepted(file: Path) -> None:
    config, rng = read(file), np.random.default_rng(0)
    (name,) = [word.removeprefix("algorithm=") for word in config["command"] if "algo" in word]
    for _ in range(50):
        drawn = {key: draw(own, rng) for key, own in config["parameters"].items()}
        values = OmegaConf.create({})
        for key, value in drawn.items():
            OmegaConf.update(values, key, value)
        algorithm = mapping("values", OmegaConf.to_object(values))["algorithm"]
        ALGORITHMS[name].from_dict(algorithm)


def test_what_an_agent_would_call_trains_and_reports_what_the_sweep_goes_by(
    tmp_path: Path,
) -> None:
    config = read(ROOT / "sweeps" / "td3.yaml")
    (tmp_path / "recipes").symlink_to(ROOT / "recipes")
    words = command(config, np.random.default_rng(1))
    identity = {"WANDB_SWEEP_ID": "sweep1", "WANDB_RUN_ID": "drawn1"}
    subprocess.run([*words, *SHORT], cwd=tmp_path, env=os.environ | identity, check=True)
    directory = tmp_path / "runs" / "sweep_sweep1" / "drawn1"
    drawn = dict(word.split("=") for word in words if word.startswith("algorithm."))
    algorithm = RunDirectory(directory).configuration().algorithm.to_dict()
    for name, value in drawn.items():
        assert algorithm[name.split(".")[1]] == pytest.approx(float(value))
    (file,) = offline_runs(directory)
    assert recorded(file, "run")[0].run_id == "drawn1"
    best = RunDirectory(directory).metrics()["best_evaluation"].max()
    assert summary(file)["best_evaluation"] == pytest.approx(best)
