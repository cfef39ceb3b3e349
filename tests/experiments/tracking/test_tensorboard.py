import sys
from pathlib import Path

import pytest
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from hyuav.experiments.run_directory import RunDirectory
from offline_wandb import history, offline_runs
from recipe_calls import TINY_COMPARISON, TINY_TRAINING, Call, Refusal

TINY = (*TINY_TRAINING, "algorithm.hidden_sizes=[8]", "scenario.num_slots=5")


def curves(directory: Path) -> dict[str, list[tuple[int, float]]]:
    """The points of each scalar that TensorBoard shows."""
    events = EventAccumulator(str(directory), size_guidance={"scalars": 0})
    events.Reload()
    tags = events.Tags()["scalars"]
    return {tag: [(each.step, each.value) for each in events.Scalars(tag)] for tag in tags}


def test_the_same_numbers_reach_tensorboard_as_weights_and_biases(
    call: Call, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    several = (*TINY, "scheme=[hybrid,relay]", "logger=wandb,tensorboard")
    call("train", "-m", "hydra.sweep.dir=runs", "hydra.sweep.subdir=${hydra.job.num}", *several)
    end = "TensorBoard: tensorboard --logdir runs/1/tensorboard\n"
    assert capsys.readouterr().out.count(end) == 1
    assert not (tmp_path / "runs" / "1" / "wandb").exists()
    (file,) = offline_runs(tmp_path / "runs" / "0")
    rows = history(file)
    shown = curves(tmp_path / "runs" / "1" / "tensorboard" / "train")
    names = {name for row in rows for name in row if not name.startswith("_")}
    assert set(shown) == names
    for name in names - {"seconds"}:
        logged = [(row["_step"], row[name]) for row in rows if name in row]
        assert [step for step, _ in shown[name]] == [step for step, _ in logged]
        assert [value for _, value in shown[name]] == pytest.approx(
            [value for _, value in logged], rel=1e-5
        )


def test_an_evaluation_goes_to_tensorboard_as_its_training_did(call: Call, tmp_path: Path) -> None:
    call("train", "hydra.run.dir=run", "logger=tensorboard", *TINY)
    few = ("evaluation.episodes=4", "evaluation.resolution=10")
    for _ in range(2):  # the second takes the place of the first
        call("evaluate", "run=run", *few)
    logs = tmp_path / "run" / "tensorboard" / "evaluate"
    shown = curves(logs)
    assert [step for step, _ in shown["proposed/secrecy_sum_rate"]] == [0]
    ((step, fraction),) = shown["optimum/fraction_of_optimum"]
    assert step == 0
    assert fraction == pytest.approx(1.0)
    events = EventAccumulator(str(logs))
    events.Reload()
    assert events.Tags()["images"] == ["figures/flight_map"]
    assert not (tmp_path / "run" / "wandb").exists()
    assert not (tmp_path / "run" / "wandb.json").exists()


def test_a_training_that_goes_on_continues_its_curves(call: Call, tmp_path: Path) -> None:
    often = "training.checkpoint_every=0"
    call("train", "hydra.run.dir=run", "logger=tensorboard", often, *TINY)
    run = RunDirectory(tmp_path / "run")
    config = run.path / "config.yaml"  # of a training of 6 episodes, of which 4 are flown
    config.write_text(config.read_text().replace("num_episodes: 4", "num_episodes: 6"))
    run.last_checkpoint.write_bytes(run.previous_checkpoint.read_bytes())
    call("train", "resume=run")
    shown = curves(run.path / "tensorboard" / "train")["hybrid/accumulated_reward"]
    kept = run.metrics()
    assert [step for step, _ in shown] == kept["episode"].tolist() == list(range(1, 7))
    assert [value for _, value in shown] == pytest.approx(kept["accumulated_reward"].tolist())


def test_each_training_of_a_comparison_has_its_own_curves(call: Call, tmp_path: Path) -> None:
    chosen = ("algorithm=[ddpg,sac]", "scenario=two_clusters", "scheme=relay")
    call("compare", *chosen, "logger=tensorboard", *TINY_COMPARISON)
    names = {path.name for path in (tmp_path / "here" / "tensorboard").iterdir()}
    assert names == {
        *("train_ddpg_two_clusters_T8", "train_sac_two_clusters_T8"),
        "comparison",
    }
    assert "ddpg/iqm" in curves(tmp_path / "here" / "tensorboard" / "comparison")


def test_without_tensorboard_one_line_says_how_to_get_it_before_anything_is_done(
    refusal: Refusal, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setitem(sys.modules, "tensorboard", None)  # as if it were not installed
    line = refusal("train", "logger=tensorboard", "hydra.run.dir=run", *TINY)
    assert line == "error: tensorboard cannot be imported: pip install 'hyuav[tensorboard]'\n"
    assert not (tmp_path / "run").exists()
