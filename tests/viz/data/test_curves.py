import numpy as np
import pandas as pd
import pytest

from hyuav.viz.data.curves import SMOOTHING, extremes, learning_curves, learning_table, quantities

EPISODES = np.arange(1, 101)
RISING = [np.linspace(0, 40 + learner, 100) for learner in range(8)]


def metrics(rewards: list[np.ndarray], scheme: str = "hybrid") -> pd.DataFrame:
    """Rows as training logs them."""
    learners = [
        pd.DataFrame({"learner": learner, "episode": EPISODES, "accumulated_reward": own})
        for learner, own in enumerate(rewards)
    ]
    return pd.concat(learners).assign(scheme=scheme, num_slots=20, loss_critic=1.0)


def test_the_table_tells_the_interquartile_mean_of_the_smoothed_rewards() -> None:
    table = learning_table(learning_curves(metrics(RISING)), {"hybrid": 55.0}, "ddpg")
    last = table.iloc[-1]
    smooth = np.sort([own[-SMOOTHING:].mean() for own in RISING])
    assert last["iqm"] == pytest.approx(smooth[2:6].mean())
    assert smooth[0] <= last["low"] < last["iqm"] < last["high"] <= smooth[-1]
    assert (last["episode"], last["learners"], last["optimum"]) == (100, 8, 55.0)
    assert table["episode"].tolist() == EPISODES.tolist()


def test_one_learner_has_a_curve_without_a_band() -> None:
    table = learning_table(learning_curves(metrics(RISING[:1], "relay")), {})
    np.testing.assert_allclose(table["low"], table["high"])
    assert table["optimum"].isna().all()


def test_a_learner_that_stops_leaves_the_mean_of_the_others() -> None:
    rows = metrics(RISING[:3])
    rows = rows[(rows["learner"] < 2) | (rows["episode"] <= 20)]
    (curve,) = learning_curves(rows)
    assert curve.middle()[-1] == pytest.approx((RISING[0][-1] + RISING[1][-1]) / 2)
    assert np.isfinite(np.array(curve.band())).all()


def test_each_scheme_and_horizon_has_a_curve_in_the_order_of_the_rows() -> None:
    several = [
        metrics(RISING[:1], scheme).assign(num_slots=num_slots)
        for scheme, num_slots in (("relay", 20), ("hybrid", 10), ("hybrid", 20))
    ]
    curves = learning_curves(pd.concat(several))
    told = [(curve.scheme, curve.num_slots) for curve in curves]
    assert told == [("re_ot", 20), ("proposed", 10), ("proposed", 20)]


def test_smoothing_counts_episodes_where_only_some_were_evaluated() -> None:
    rows = metrics([EPISODES.astype(float)]).iloc[4::5]
    (curve,) = learning_curves(rows)
    smooth = curve.smoothed(10)  # two evaluations, five episodes from each other
    assert smooth.learners[0].tolist()[:3] == [5.0, 7.5, 12.5]


def test_what_was_not_measured_is_left_out_of_a_line() -> None:
    x, y = extremes(np.arange(4.0), np.array([np.nan, 1.0, np.nan, 2.0]), 10)
    assert (x.tolist(), y.tolist()) == ([1.0, 3.0], [1.0, 2.0])


def test_the_losses_come_behind_the_returns() -> None:
    assert list(quantities({"run": metrics(RISING)})) == ["accumulated_reward", "loss_critic"]
