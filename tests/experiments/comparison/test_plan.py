"""How the learners of a comparison are divided among the workers."""

from hyuav.experiments.comparison.plan import Compare, parameters_of


def test_learners_are_divided_into_near_equal_shards_that_fit_a_worker() -> None:
    options = Compare(scheme=("hybrid", "relay"), learners=25, seed=7, shard_learners=20)
    parts = options.parts()
    assert [place for part in parts for place in part] == list(range(len(options.members)))
    assert sorted(len(part) for part in parts) == [16, 17, 17]
    assert len(set(options.members)) == 50
    assert options.members[25].scheme == "relay"
    assert options.members[25].seed == 7


def test_few_learners_are_one_shard() -> None:
    assert Compare(learners=20).parts() == [range(60)]
    assert Compare(learners=1, scheme=("hybrid",)).parts() == [range(1)]


def test_a_piece_is_left_out_where_an_algorithm_has_it() -> None:
    options = Compare(algorithm=("ddpg_robust", "ddpg", "sac"), without=("action_scale", "clock"))
    without = ("ddpg_robust-action_scale", "ddpg_robust-clock")
    assert options.entries == ("ddpg_robust", *without, "ddpg", "sac")
    assert parameters_of("ddpg_robust-clock").clock is False
    assert parameters_of("sac-action_scale") == parameters_of("sac")
