from hyuav.experiments.schemes import LABELS, OPTIMA
from hyuav.viz.data.schemes import COLORS, DRAWN, scheme_line, scheme_place


def test_the_drawn_schemes_differ_in_color_and_those_that_only_jam_are_dashed() -> None:
    assert len({COLORS[scheme] for scheme in DRAWN}) == 7
    lines = {scheme: scheme_line(scheme) for scheme in DRAWN}
    assert {scheme for scheme, line in lines.items() if line == "dashed"} == {"ja_ot", "ja_lt"}


def test_optima_are_dotted_in_the_color_of_what_they_bound() -> None:
    assert {scheme_line(optimum) for optimum in (*OPTIMA.values(), "optimum_power")} == {"dotted"}
    assert COLORS["ja_optimum"] == COLORS["ja_ot"]
    assert COLORS["optimum_power"] == COLORS["proposed_power"]


def test_unknown_schemes_come_last() -> None:
    assert sorted(["another", *reversed(LABELS)], key=scheme_place) == [*LABELS, "another"]
