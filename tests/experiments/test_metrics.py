import pandas as pd
import pytest

from hyuav.experiments.metrics import finite_numbers, parse_rows

COLUMNS = ["episode", "learner", "scheme", "evaluation"]


@pytest.mark.parametrize("value", ["1" * 400, "inf", "-inf", "1e999", "nan", "x", "0x10", ""])
def test_what_is_no_finite_number_in_metrics_is_none(value: str) -> None:
    assert finite_numbers(pd.Series([value, "2"])).isna().tolist() == [True, False]


def test_a_whole_number_of_hundreds_of_digits_leaves_the_others() -> None:
    assert finite_numbers(pd.Series([10**400, 3])).fillna(-1.0).tolist() == [-1.0, 3.0]


def test_whole_rows_are_read_and_damaged_ones_left_out() -> None:
    lines = (
        b"1,0,hybrid,2.5\n2,0,hybrid\n3,0,hybrid,4,5\n,0,hybrid,1\n4,1,relay,\n5,0,hy\0brid,inf\n"
    )
    rows = parse_rows(lines, COLUMNS)
    assert rows["episode"].tolist() == [1.0, 4.0, 5.0]
    assert rows["scheme"].tolist() == ["hybrid", "relay", "hybrid"]
    assert rows["evaluation"].isna().tolist() == [False, True, True]
