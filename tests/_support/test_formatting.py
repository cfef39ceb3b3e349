from hyuav._support.formatting import bounds, interval, or_never, percent


def test_shares_are_written_in_percent() -> None:
    assert percent(0.98765) == "98.8 %"
    assert percent(0.5, 0) == "50 %"
    assert percent(0.975, None) == "97.5 %"
    assert percent(None) == "-"


def test_a_value_stands_before_its_interval() -> None:
    assert interval(1.234, 1.0, 2.0) == "1.23 [1.00, 2.00]"
    assert bounds(99.04, 99.96, 1) == "[99.0, 100.0]"


def test_what_never_happened_is_said_to() -> None:
    assert or_never(12.34, 1) == "12.3"
    assert or_never(float("inf"), 0) == "never"
