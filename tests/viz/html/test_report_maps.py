import dataclasses

import numpy as np
import pytest

from hyuav import Scenario
from hyuav.viz.data.maps import Mode, helper_map
from hyuav.viz.html.maps import sum_rate_map

SCENARIO = Scenario.preset("random_disk")


@pytest.mark.parametrize("mode", ["relay", "jamming", "better"])
def test_a_map_shows_the_rates_on_one_scale(mode: Mode) -> None:
    rates = helper_map(SCENARIO, 10.0).rates
    heat = sum_rate_map(SCENARIO, mode, 10.0).data[0]
    np.testing.assert_allclose(heat.z, rates[mode], rtol=1e-6)
    assert (heat.zmin, heat.zmax) == (0.0, rates["better"].max())
    assert heat.colorbar.title.text == "Secrecy sum-rate (bps/Hz)<br>without a helper 18.52"


@pytest.mark.parametrize("preset", ["random_disk", "two_clusters"])
def test_the_map_of_the_better_mode_outlines_where_each_mode_is_better(preset: str) -> None:
    scenario = Scenario.preset(preset)
    rates = helper_map(scenario, 10.0).rates
    lines = {
        trace.line.dash: np.array(trace.z)
        for trace in sum_rate_map(scenario, "better", 10.0).data
        if trace.type == "contour"
    }
    np.testing.assert_array_equal(lines["solid"] > 0.5, rates["relay"] > rates["jamming"])
    np.testing.assert_array_equal(lines["dash"] > 0.5, rates["jamming"] > rates["relay"])
    for region in lines.values():  # so that a line is drawn between its points
        assert (region.min(), region.max()) == (0.0, 1.0)


def test_no_line_is_drawn_around_a_mode_that_is_nowhere_better() -> None:
    scenario = dataclasses.replace(SCENARIO, jamming_power=1e-9)
    rates = helper_map(scenario, 10.0).rates
    assert not (rates["relay"] > rates["jamming"]).any()
    figure = sum_rate_map(scenario, "better", 10.0)
    assert [trace.line.dash for trace in figure.data if trace.type == "contour"] == ["dash"]
