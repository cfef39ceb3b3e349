import dataclasses
from pathlib import Path

import pandas as pd
import pytest

from hyuav import InputError
from hyuav.experiments.run_directory import RunDirectory
from hyuav.experiments.train import resume, train
from sample_runs import ONE_OF_EACH, SILENT, UNLOGGED


def test_a_resumed_training_brings_what_an_unbroken_one_does(tmp_path: Path) -> None:
    longer = dataclasses.replace(ONE_OF_EACH.training, num_episodes=6)
    unbroken = dataclasses.replace(ONE_OF_EACH, training=longer)
    expected = train(tmp_path / "unbroken", unbroken, UNLOGGED, SILENT).metrics()
    run = train(tmp_path / "run", ONE_OF_EACH, UNLOGGED, SILENT)
    config = run.config_file.read_text()
    run.config_file.write_text(config.replace("num_episodes: 4", "num_episodes: 6"))
    metrics = resume(run.path, UNLOGGED, SILENT).metrics()
    pd.testing.assert_frame_equal(
        metrics.drop(columns="seconds"), expected.drop(columns="seconds"), check_exact=True
    )


def test_a_run_without_a_checkpoint_cannot_be_resumed(tmp_path: Path) -> None:
    run = RunDirectory.create(tmp_path / "run", ONE_OF_EACH)
    with pytest.raises(InputError, match=r"checkpoint = .*: expected a checkpoint of kind"):
        resume(run.path, UNLOGGED, SILENT)
