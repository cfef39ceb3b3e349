"""A shard's tables, in which every learner stands beside the optimum in the same episodes."""

import dataclasses
import os
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from rich.console import Console

from faults import leave_overflowing
from hyuav import Scenario
from hyuav._support.errors import BusyError, InputError
from hyuav.experiments.comparison.optima import Optima
from hyuav.experiments.comparison.plan import parameters_of, training_episodes
from hyuav.experiments.comparison.shards import Shard
from hyuav.experiments.evaluation import EvaluationParameters, fly
from hyuav.experiments.run_directory import RunConfiguration, RunDirectory
from hyuav.experiments.schemes import OPTIMA
from hyuav.experiments.tracking import LoggerParameters, Tracker
from hyuav.experiments.train import train
from hyuav.learning.learners import Learner
from hyuav.learning.policy import learned_policy
from hyuav.learning.registry import PEER
from hyuav.learning.training import Training, TrainingParameters
from hyuav.references import bounds
from hyuav.references.optimum import solve_optimum
from hyuav.references.straight import no_helper

TRAINING = TrainingParameters(
    num_episodes=5,
    batch_size=8,
    evaluation_every=2,
    evaluation_episodes=6,
    compile="never",
    cohorts=1,
)
EVALUATION = EvaluationParameters(episodes=7, resolution=10.0)
SCENARIO = Scenario(
    ue_positions=((5.0, 6.0), (-7.0, 8.0)), helper_starts=((-20.0, -20.0),), num_slots=6
)
LEARNERS = tuple(Learner(scheme, seed) for scheme in ("relay", "hybrid") for seed in (3, 4))


@pytest.fixture(scope="module")
def optima(tmp_path_factory: pytest.TempPathFactory) -> Optima:
    file = tmp_path_factory.mktemp("optima") / "campus.parquet"
    optima = Optima(SCENARIO, (6, 8), EVALUATION.resolution, file)
    optima.solve()
    return optima


def shard(optima: Optima, parent: Path, algorithm: str = "ddpg") -> Shard:
    parameters = parameters_of(algorithm)
    configuration = RunConfiguration("campus", SCENARIO, LEARNERS, algorithm, parameters, TRAINING)
    logger = LoggerParameters(mode="disabled")
    return Shard(algorithm, configuration, EVALUATION, 0.5, logger, optima, parent)


@pytest.fixture(scope="module")
def finished(optima: Optima, tmp_path_factory: pytest.TempPathFactory) -> Shard:
    work = shard(optima, tmp_path_factory.mktemp("finished"))
    work.run()
    return work


def test_the_optima_are_kept_as_they_were_found(optima: Optima) -> None:
    found = solve_optimum(SCENARIO, resolution=EVALUATION.resolution)
    for scheme, optimum in found.items():
        path = optima.policy(scheme, 6).get_buffer("path")
        assert np.array_equal(path, optimum.path)
    assert len(optima.policy("relay", 8).get_buffer("path")) == 9
    assert optima.upper_bound("relay", 8) is None
    kept = pd.read_parquet(optima.file).query("num_slots == 6").groupby("scheme")["value"].first()
    assert kept.to_dict() == {scheme: optimum.value for scheme, optimum in found.items()}


def test_the_optima_of_several_helpers_are_kept_with_their_upper_bounds(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bounds, "FIRST_CELLS", 6**4)  # which makes them coarse
    monkeypatch.setattr(bounds, "ROUNDS", 0)
    two = dataclasses.replace(Scenario.preset("two_eavesdroppers"), num_slots=2, fading=False)
    optima = Optima(two, (2,), 20.0, tmp_path / "two.parquet")
    optima.solve()
    assert optima.is_solved
    kept = pd.read_parquet(optima.file)
    assert {"x_1", "y_2", "power_2"} < set(kept.columns)
    for scheme in OPTIMA:
        path = optima.policy(scheme, 2).get_buffer("path")
        assert path[0].tolist() == [list(start) for start in two.helper_starts]
        bound = optima.upper_bound(scheme, 2)
        assert bound is not None
        assert bound >= kept[kept["scheme"] == scheme]["value"].iloc[0]


def test_a_training_is_evaluated_in_the_episodes_that_its_optimum_flies() -> None:
    training = Training(SCENARIO, [Learner("relay", 3)], parameters_of("ddpg"), TRAINING)
    policy = learned_policy(SCENARIO, parameters_of("ddpg"), training.best_weights)
    totals = fly(SCENARIO, "re_ot", policy, training_episodes(TRAINING)).totals
    penalty = SCENARIO.off_map_penalty * totals["off_map"]
    flown = (totals["secrecy_sum_rate"] - penalty).mean()
    assert training.evaluate().reward.item() == pytest.approx(float(flown), rel=1e-5)
    sum_rate = totals["secrecy_sum_rate"].mean().item()
    assert training.evaluate().sum_rate.item() == pytest.approx(sum_rate, rel=1e-5)


def test_learners_are_set_beside_the_optimum(optima: Optima, tmp_path: Path) -> None:
    work = shard(optima, tmp_path)
    metrics = pd.DataFrame(
        [
            {
                "learner": learner,
                "episode": episode,
                "slots": 6 * episode,
                "seconds": 0.5 * episode,
                "evaluation": {2: 1.0, 4: 3.0, 5: 2.0}[episode],
                "sum_rate": {2: 0.0, 4: 1000.0, 5: 2000.0}[episode] * (learner == 1),
            }
            for episode in (2, 4, 5)
            for learner in range(4)
        ]
    )
    results, curves = work.tables(metrics, *([[1.0, 2.0, 3.0, 4.0]] * 2))
    assert results["scheme"].tolist() == ["relay", "relay", "hybrid", "hybrid"]
    assert results["seed"].tolist() == [3, 4, 3, 4]
    assert results["sum_rate"].tolist() == [1.0, 2.0, 3.0, 4.0]
    flights = fly(SCENARIO, "re_optimum", optima.policy("relay", 6), EVALUATION)
    optimum = float(flights.totals["secrecy_sum_rate"].mean())
    assert results["optimum"][0] == optimum
    assert results["fraction"][1] == 2.0 / optimum
    alone = fly(SCENARIO, "no_helper", no_helper(SCENARIO), EVALUATION).totals["secrecy_sum_rate"]
    assert results["no_helper"].tolist() == [float(alone.mean())] * 4
    assert results["episodes_to_threshold"].tolist()[1] == 4
    assert results["seconds_to_threshold"].tolist()[1] == 2.0
    assert results["episodes_to_threshold"].isna().tolist() == [True, False, True, True]
    assert results["seconds"].tolist() == [2.5] * 4
    assert len(curves) == 12
    solved = curves[curves["fraction"] > 0]
    assert solved["best_sum_rate"].tolist() == [1000.0, 1000.0]  # the best by reward


@pytest.mark.parametrize("algorithm", ["sac", PEER])
def test_a_shard_trains_and_keeps_its_tables(
    optima: Optima, tmp_path: Path, algorithm: str
) -> None:
    if algorithm == PEER:
        pytest.importorskip(PEER)
    work = shard(optima, tmp_path, algorithm)
    work.run()
    assert work.is_finished
    assert [path.name for path in tmp_path.iterdir()] == [f"{algorithm}_campus_T6"]
    results = pd.read_parquet(work.path / "results.parquet")
    curves = pd.read_parquet(work.path / "curves.parquet")
    assert list(zip(results["scheme"], results["seed"], strict=True)) == [
        (learner.scheme, learner.seed) for learner in LEARNERS
    ]
    assert results["fraction"].between(0.0, 1.05).all()
    assert results["sum_rate"].nunique() == 4
    assert (results["seconds"] > 0).all()
    for _, curve in curves.groupby(["scheme", "seed"]):
        assert curve["episode"].tolist() == [2, 4, 5]
        assert curve["slots"].tolist() == [12, 24, 30]
        best = curve["sum_rate"].to_numpy()[curve["evaluation"].argmax()]
        assert curve["best_sum_rate"].iloc[-1] == best
        assert (curve["sum_rate"] >= curve["evaluation"] - 1e-5).all()


def test_a_shard_of_this_project_is_a_run(finished: Shard) -> None:
    work = finished
    assert RunDirectory(work.path).configuration() == work.configuration
    assert [file.name for file in (work.path / "checkpoints").iterdir()] == ["best.pt"]
    results = pd.read_parquet(work.path / "results.parquet")
    weights = RunDirectory(work.path).best_weights()
    last = learned_policy(SCENARIO, work.configuration.algorithm, weights, [3])
    flights = fly(SCENARIO, "proposed", last, EVALUATION)
    expected = float(flights.totals["secrecy_sum_rate"].mean())
    assert results["sum_rate"].iloc[3] == pytest.approx(expected, rel=1e-5)


def test_what_another_process_trains_is_not_begun_again(optima: Optima, tmp_path: Path) -> None:
    work = shard(optima, tmp_path)
    run = RunDirectory.create(tmp_path / "ddpg_campus_T6.partial", work.configuration)
    with run.reserved(), pytest.raises(BusyError, match="no other process trains"):
        work.run()
    assert run.exists


def test_a_scheme_whose_optimum_earns_nothing_is_refused_before_training(tmp_path: Path) -> None:
    deaf = dataclasses.replace(SCENARIO, ue_power=1e-30)
    optima = Optima(deaf, (6,), EVALUATION.resolution, tmp_path / "deaf.parquet")
    optima.solve()
    work = shard(optima, tmp_path / "shards")
    configuration = dataclasses.replace(work.configuration, scenario=deaf)
    with pytest.raises(InputError, match="scheme = 'relay': expected one whose optimum earns"):
        dataclasses.replace(work, configuration=configuration).run()
    assert not (tmp_path / "shards").exists()


def test_a_broken_attempt_goes_on_from_its_checkpoint(
    optima: Optima, finished: Shard, tmp_path: Path
) -> None:
    broken = shard(optima, tmp_path / "broken")
    run = RunDirectory.create(tmp_path / "broken/ddpg_campus_T6.partial", broken.configuration)
    configuration = broken.configuration
    training = configuration.new_training()
    with Tracker(run, configuration, training, broken.logger, Console(quiet=True)) as tracker:
        for episode in training.episodes():
            tracker.log(episode)
            if episode.number == 3:
                tracker.save()
                break
    os.utime(run.config_file, (1.0, 1.0))
    broken.run()
    assert (broken.path / "config.yaml").stat().st_mtime == 1.0  # not begun again
    for name in ("results.parquet", "curves.parquet"):
        kept, expected = (pd.read_parquet(own.path / name) for own in (broken, finished))
        clock = [column for column in kept.columns if column.startswith("seconds")]
        pd.testing.assert_frame_equal(
            kept.drop(columns=clock), expected.drop(columns=clock), check_exact=True
        )


@pytest.mark.parametrize(("flown", "learners"), [(0, [1]), (3, [1]), (3, [0, 1, 2, 3])])
def test_learners_that_stop_count_with_their_last_good_weights(
    optima: Optima, finished: Shard, tmp_path: Path, flown: int, learners: list[int]
) -> None:
    work = shard(optima, tmp_path / "stopped")
    partial = tmp_path / "stopped" / f"{work.name}.partial"
    leave_overflowing(partial, work.configuration, flown, learners)
    work.run()
    results, expected = (pd.read_parquet(own.path / "results.parquet") for own in (work, finished))
    stopped = results.index.isin(learners)
    assert results["stopped"].isna().tolist() == [not own for own in stopped]
    assert (results.loc[stopped, "stopped"] > flown).all()
    assert expected["stopped"].isna().all()
    clock = ["seconds", "seconds_to_threshold"]
    kept, others = (own[~stopped].drop(columns=clock) for own in (results, expected))
    pd.testing.assert_frame_equal(kept, others, check_exact=True, check_dtype=False)
    curves = pd.read_parquet(work.path / "curves.parquet")
    for _, learner in results[stopped].iterrows():
        assert np.isfinite(learner["sum_rate"])
        own = curves[(curves["scheme"] == learner["scheme"]) & (curves["seed"] == learner["seed"])]
        assert own["episode"].tolist() == ([2] if flown else [])


def cut(file: Path, share: float = 0.6) -> None:
    file.write_bytes(file.read_bytes()[: int(share * file.stat().st_size)])


def assert_as_before(work: Shard, before: Shard) -> None:
    """The tables are whole, and the same but for the clock."""
    kept, expected = work.kept(), before.kept()
    assert kept is not None
    assert expected is not None
    for own, other in zip(kept, expected, strict=True):
        clock = [column for column in own.columns if column.startswith("seconds")]
        pd.testing.assert_frame_equal(
            own.drop(columns=clock), other.drop(columns=clock), check_exact=True
        )


@pytest.mark.parametrize("damage", ["cut", "empty", "missing", "foreign"])
@pytest.mark.parametrize("name", ["results.parquet", "curves.parquet"])
def test_damaged_tables_are_made_anew_from_the_weights(
    finished: Shard, tmp_path: Path, name: str, damage: str
) -> None:
    work = dataclasses.replace(finished, parent=tmp_path)
    shutil.copytree(finished.path, work.path)
    file, weights = work.path / name, work.path / "checkpoints" / "best.pt"
    if damage == "cut":
        cut(file)
    elif damage == "empty":
        file.write_bytes(b"")
    elif damage == "missing":
        file.unlink()
    else:
        pd.DataFrame({"seed": range(4)}).to_parquet(file)
    os.utime(weights, (1.0, 1.0))
    assert not work.is_finished
    work.run()
    assert_as_before(work, finished)
    assert weights.stat().st_mtime == 1.0  # not trained again


@pytest.mark.parametrize("damaged", ["checkpoints/best.pt", "metrics.csv", "config.yaml"])
def test_what_cannot_be_evaluated_again_is_trained_again(
    finished: Shard, tmp_path: Path, damaged: str
) -> None:
    work = dataclasses.replace(finished, parent=tmp_path)
    shutil.copytree(finished.path, work.path)
    cut(work.path / damaged)
    (work.path / "curves.parquet").unlink()
    work.run()
    assert_as_before(work, finished)
    assert [path.name for path in tmp_path.iterdir()] == [work.name]


def test_best_weights_that_are_damaged_come_back_from_the_last_checkpoint(
    finished: Shard, tmp_path: Path
) -> None:
    work = dataclasses.replace(finished, parent=tmp_path)
    partial = tmp_path / f"{work.name}.partial"
    run = train(partial, work.configuration, work.logger, Console(quiet=True))
    cut(run.best_checkpoint)
    os.utime(run.config_file, (1.0, 1.0))
    work.run()
    assert_as_before(work, finished)
    assert (work.path / "config.yaml").stat().st_mtime == 1.0  # not begun again


@pytest.mark.parametrize("share", [0.0, 0.6])
def test_a_damaged_optimum_is_none(optima: Optima, tmp_path: Path, share: float) -> None:
    assert optima.is_solved
    damaged = dataclasses.replace(optima, file=tmp_path / "campus.parquet")
    assert not damaged.is_solved
    shutil.copy(optima.file, damaged.file)
    assert damaged.is_solved
    assert not dataclasses.replace(damaged, horizons=(6, 9)).is_solved
    cut(damaged.file, share)
    assert not damaged.is_solved
    with pytest.raises(InputError, match=r"campus\.parquet: expected best flights in Parquet \("):
        damaged.policy("relay", 6)


@pytest.mark.parametrize("left", ["another", "nothing", "damaged"])
def test_an_attempt_of_no_use_is_begun_again(optima: Optima, tmp_path: Path, left: str) -> None:
    work = shard(optima, tmp_path)
    configuration = work.configuration
    if left == "another":
        configuration = dataclasses.replace(configuration, learners=LEARNERS[:2])
    run = RunDirectory.create(tmp_path / f"{work.name}.partial", configuration)
    if left == "damaged":
        run.last_checkpoint.parent.mkdir()
        run.last_checkpoint.write_bytes(b"PK")
    work.run()
    assert len(pd.read_parquet(work.path / "results.parquet")) == 4
    assert RunDirectory(work.path).configuration() == work.configuration


def test_an_evaluation_in_training_needs_two_episodes() -> None:
    with pytest.raises(InputError, match=r"^evaluation_episodes = 1: expected a whole number >= 2"):
        training_episodes(TrainingParameters(evaluation_episodes=1))
