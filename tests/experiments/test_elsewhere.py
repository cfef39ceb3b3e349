"""Where trained actors are flown, and where what comes of it is kept."""

import dataclasses
from pathlib import Path

import pytest

from hyuav import InputError, Learner, Scenario
from hyuav.experiments.elsewhere import Destination, as_trained, destination, runs_in
from hyuav.experiments.run_directory import RunConfiguration, RunDirectory
from sample_runs import ONE_OF_EACH

LOUD = dataclasses.replace(ONE_OF_EACH.scenario, jamming_power=0.2, num_slots=20)


def run(
    directory: Path, horizons: tuple[int | None, ...], scenario: Scenario = LOUD
) -> RunDirectory:
    """A training on two clusters that is only configured, with a learner for each horizon."""
    learners = tuple(Learner("hybrid", seed, own) for seed, own in enumerate(horizons))
    configuration = dataclasses.replace(ONE_OF_EACH, scenario=scenario, learners=learners)
    return RunDirectory.create(directory, configuration)


def changed(**fields: object) -> dict[str, object]:
    return {**as_trained(), **fields}


def test_by_default_actors_fly_where_and_as_long_as_they_were_trained(tmp_path: Path) -> None:
    for horizons, own in (((None,), 20), ((8,), 8), ((8, 20), 20), ((8, 12), 12)):
        trained = run(tmp_path / str(horizons), horizons)
        flown = destination([trained], as_trained())
        assert flown.scenario == dataclasses.replace(LOUD, num_slots=own)
        assert flown.name == "two_clusters"
        assert flown.num_slots == own
        assert flown.directory(trained) == trained.path


@pytest.mark.parametrize(
    ("values", "num_slots", "keeps_horizon", "flown", "trained_for", "place"),
    [
        (as_trained(), 8, True, 8, 8, "horizons/T8"),
        (changed(num_slots=8), None, False, 8, 8, "horizons/T8"),
        (changed(num_slots=9), None, False, 9, 20, "elsewhere/two_clusters_T9_trained_for_T20_"),
        (changed(num_slots=9), 8, False, 9, 8, "elsewhere/two_clusters_T9_trained_for_T8_"),
        (changed(jamming_power=0.3), None, True, 20, 20, "elsewhere/two_clusters_T20_"),
        ({"name": "random_disk"}, 8, True, 8, 8, "elsewhere/random_disk_T8"),
        ({"name": "../x", "ue_positions": [[0, 1]]}, None, True, 20, 20, "elsewhere/_x_T20_"),
    ],
)
def test_an_evaluation_elsewhere_has_a_place_of_its_own(
    tmp_path: Path,
    values: dict[str, object],
    num_slots: int | None,
    keeps_horizon: bool,
    flown: int,
    trained_for: int,
    place: str,
) -> None:
    trained = run(tmp_path / "run", (8, 20))
    found = destination([trained], values, num_slots, keeps_horizon=keeps_horizon)
    assert (found.scenario.num_slots, found.num_slots) == (flown, trained_for)
    kept = str(found.directory(trained).relative_to(trained.path))
    assert kept.startswith(place)
    assert len(kept) == len(place) + (8 if place.endswith("_") else 0)


def test_values_that_are_not_given_are_the_runs_and_those_of_another_scenario_its_own(
    tmp_path: Path,
) -> None:
    trained = run(tmp_path / "run", (None,))
    faster = destination([trained], changed(max_speed=25.0)).scenario
    assert faster == dataclasses.replace(LOUD, max_speed=25.0)
    preset = destination([trained], {"name": "two_clusters"})
    assert preset.scenario == Scenario.preset("two_clusters")
    assert preset.directory(trained) == trained.path / "elsewhere" / "two_clusters_T20"


def test_places_of_scenarios_that_differ_differ(tmp_path: Path) -> None:
    trained = run(tmp_path / "run", (None,))
    flown = [destination([trained], changed(relay_power=power)) for power in (0.1, 0.2, 0.3)]
    assert len({own.directory(trained) for own in flown}) == 3


def test_runs_of_several_scenarios_are_flown_over_another_one_alone(tmp_path: Path) -> None:
    runs = [run(tmp_path / "a", (None,)), run(tmp_path / "b", (8,), ONE_OF_EACH.scenario)]
    accepted = r"run = '.*b': expected the scenario of .*a, or scenario=NAME for all of them$"
    with pytest.raises(InputError, match=accepted):
        destination(runs, as_trained())
    assert isinstance(destination(runs, {"name": "random_disk"}), Destination)
    same = [runs[0], run(tmp_path / "c", (5,), dataclasses.replace(LOUD, num_slots=5))]
    assert destination(same, as_trained()).scenario == LOUD  # the horizon may differ


def test_a_directory_of_runs_stands_for_them_in_their_order(tmp_path: Path) -> None:
    sweep = tmp_path / "sweep"
    for number in (10, 9, 0):
        run(sweep / f"{number}_two_clusters_ddpg_0", (None,))
    (sweep / "11_halted").mkdir()
    names = [own.path.name for own in runs_in(sweep)]
    assert names == [f"{number}_two_clusters_ddpg_0" for number in (0, 9, 10)]
    assert [own.path for own in runs_in(sweep / names[1])] == [sweep / names[1]]
    assert [own.path for own in runs_in(tmp_path / "none")] == [tmp_path / "none"]


def test_a_comparison_stands_for_its_finished_trainings(tmp_path: Path) -> None:
    (tmp_path / "config.yaml").write_text("learners: 2\nhyperparameters: {}\n")
    run(tmp_path / "shards" / "ddpg_two_clusters_T20", (None,))
    run(tmp_path / "shards" / "td3_two_clusters_T20.partial", (None,))
    (tmp_path / "shards" / "stable_baselines3_two_clusters_T20").mkdir()
    assert [own.path.name for own in runs_in(tmp_path)] == ["ddpg_two_clusters_T20"]


def test_a_main_job_is_a_run_though_another_is_in_it(tmp_path: Path) -> None:
    run(tmp_path, (None,))
    run(tmp_path / "as_in_paper", (None,))
    assert [own.path for own in runs_in(tmp_path)] == [tmp_path]
    (tmp_path / "config.yaml").write_text("[damaged")
    assert [own.path for own in runs_in(tmp_path)] == [tmp_path]


def test_the_trained_scenario_is_over_a_horizon_of_the_learners() -> None:
    for learners, expected in (
        ((Learner(),), 20),
        ((Learner(num_slots=4), Learner("relay", 0, 6)), 6),
    ):
        configuration: RunConfiguration = dataclasses.replace(
            ONE_OF_EACH, scenario=LOUD, learners=learners
        )
        assert configuration.trained_scenario.num_slots == expected
