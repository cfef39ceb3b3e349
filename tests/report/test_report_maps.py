import numpy as np
import pytest

from hyuav import Scenario
from hyuav.maps import Mode, sum_rates_over_map
from hyuav.report.maps import sum_rate_map

SCENARIO = Scenario.preset("random_disk")


@pytest.mark.parametrize("mode", ["relay", "jamming", "better"])
def test_a_map_shows_the_rates_on_one_scale(mode: Mode) -> None:
    rates = sum_rates_over_map(SCENARIO, 10.0)
    heat = sum_rate_map(SCENARIO, mode, 10.0).data[0]
    np.testing.assert_allclose(heat.z, rates.of(mode), rtol=1e-6)
    assert (heat.zmin, heat.zmax) == (0.0, rates.better.max())
    assert heat.colorbar.title.text == "Secrecy sum-rate (bps/Hz)"


def test_the_map_of_the_better_mode_tells_where_it_changes() -> None:
    rates = sum_rates_over_map(SCENARIO, 10.0)
    (contour,) = (t for t in sum_rate_map(SCENARIO, "better", 10.0).data if t.type == "contour")
    somewhere = rates.better > 0
    np.testing.assert_array_equal(
        np.array(contour.z)[somewhere] == 1, (rates.relay > rates.jamming)[somewhere]
    )
