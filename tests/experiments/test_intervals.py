"""Interquartile means and intervals against numbers worked out by hand and by resampling."""

import warnings

import numpy as np
import pytest

from hyuav.experiments.intervals import (
    Array,
    interquartile_band,
    interquartile_curve,
    interquartile_mean,
    stratified_interval,
)


def normal(*shape: int) -> Array:
    return np.random.default_rng(0).standard_normal(shape)


def test_the_interquartile_mean_leaves_out_the_outer_quarters() -> None:
    assert interquartile_mean([np.arange(8.0)]) == (2 + 3 + 4 + 5) / 4
    assert interquartile_mean([np.arange(10.0)]) == (2 + 3 + 4 + 5 + 6 + 7) / 6
    assert interquartile_mean([np.array([0.0, 1.0]), np.array([2.0, 99.0])]) == 1.5


def test_an_interval_covers_the_value_as_often_as_it_says() -> None:
    draws = normal(200, 30)
    intervals = [stratified_interval([sample], interquartile_mean) for sample in draws]
    assert 0.88 <= np.mean([low <= 0.0 <= high for low, high in intervals]) <= 0.99


def test_an_interval_is_that_of_resamples_drawn_by_hand() -> None:
    sample, rng = normal(40), np.random.default_rng(1)
    means = sample[rng.integers(40, size=(20_000, 40))].mean(axis=1)
    expected = np.quantile(means, (0.025, 0.975))
    low, high = stratified_interval([sample], lambda drawn: np.concatenate(drawn, axis=-1).mean(-1))
    np.testing.assert_allclose((low, high), expected, atol=0.02)


def test_the_cells_are_kept_apart() -> None:
    """Cells that differ among, but not within, themselves leave nothing to chance."""
    low, high = stratified_interval([np.zeros(5), np.ones(5)], interquartile_mean)
    assert low == high == 0.5


@pytest.mark.parametrize("samples", [[0.5], [0.5, 0.5, 0.5]])
def test_samples_that_do_not_vary_are_their_own_interval(samples: list[float]) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        low, high = stratified_interval([np.array(samples)], interquartile_mean)
    assert low == high == 0.5


def test_a_cell_of_one_learner_has_the_weight_of_one() -> None:
    low, high = stratified_interval([np.array([1.0]), np.zeros(3)], interquartile_mean)
    assert low == high == 0.0
    mean = interquartile_mean([np.array([1.0]), np.zeros(3)])
    assert mean == 0.0


def test_a_curve_counts_in_each_row_the_samples_that_it_knows() -> None:
    samples = normal(6, 9)
    samples[2:, 4] = np.nan
    samples[4, 1:] = np.nan
    samples[5] = np.nan
    curve, (low, high) = interquartile_curve(samples), interquartile_band(samples)
    for row in range(5):
        own = samples[row][~np.isnan(samples[row])]
        assert curve[row] == pytest.approx(interquartile_mean([own]))
        expected = stratified_interval([own], interquartile_mean)
        assert (low[row], high[row]) == pytest.approx(expected, abs=0.3)  # by other resamples
        assert low[row] <= curve[row] <= high[row]
    assert np.isnan([curve[5], low[5], high[5]]).all()
