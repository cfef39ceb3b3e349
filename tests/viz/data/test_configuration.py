from hyuav.viz.data.configuration import SYMBOLS, differences, entries


def test_nested_entries_have_dotted_names() -> None:
    config = {"training": {"num_episodes": 3, "replay": {"size": 8}}, "seed": 1, "none": {}}
    assert entries(config, "") == [
        ("training.num_episodes", 3),
        ("training.replay.size", 8),
        ("seed", 1),
        ("none", {}),
    ]


def test_only_entries_that_differ_are_told_and_long_ones_are_cut() -> None:
    shared = {"scenario": {"name": "campus"}, "training": {"num_episodes": 3}}
    other = {"scenario": {"name": "campus"}, "training": {"num_episodes": "9" * 200}}
    table = differences({"one": shared, "other": other})
    assert table.index.tolist() == ["training.num_episodes"]
    assert table.loc["training.num_episodes", "one"] == "3"
    assert len(str(table.loc["training.num_episodes", "other"])) == 80


def test_parameters_of_the_scenario_have_their_symbol_and_unit() -> None:
    assert SYMBOLS["scenario.coverage_radius"] == "D_max (m)"
