"""Layouts by name and by their parameters."""

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hyuav import InputError, clusters, disk, random_layout
from hyuav.physics.families import (
    LAYOUTS,
    ClustersLayout,
    DiskLayout,
    RandomLayout,
    drawn_scenario,
)

SEEDS = st.integers(0, 2**40)


@given(SEEDS)
def test_a_seed_draws_what_the_functions_draw(seed: int) -> None:
    assert DiskLayout(7, 20.0, (5.0, 6.0)).draw(seed) == disk(7, 20.0, (5.0, 6.0), seed=seed)
    named = ClustersLayout(sizes=(2, 3), cluster_radius=4.0, spread=9.0, center=(1.0, 2.0))
    assert named.draw(seed) == clusters([2, 3], 4.0, 9.0, (1.0, 2.0), seed=seed)
    assert RandomLayout().draw(seed) == random_layout(seed)


@given(st.integers(1, 200), st.integers(1, 200))
def test_clusters_without_sizes_are_as_equal_as_can_be(num_ues: int, num_clusters: int) -> None:
    if num_clusters > num_ues:
        with pytest.raises(InputError, match=f"^num_clusters = {num_clusters}: expected at most"):
            ClustersLayout(num_ues, num_clusters)
        return
    sizes = ClustersLayout(num_ues, num_clusters).cluster_sizes
    assert len(sizes) == num_clusters
    assert sum(sizes) == num_ues
    assert max(sizes) - min(sizes) <= 1


@pytest.mark.parametrize("name", LAYOUTS)
@given(seed=SEEDS)
def test_a_layout_lies_within_its_extent(name: str, seed: int) -> None:
    layout = LAYOUTS[name]()
    drawn = layout.draw(seed)
    assert max(abs(x) for position in drawn for x in position) <= layout.extent
    layout.require_on_map(2 * layout.extent)


@pytest.mark.parametrize(
    ("fields", "line"),
    [
        ({"layout": "disk", "radius": 101.0}, "radius = 101.0: expected center + radius within"),
        ({"layout": "disk", "center": (60.0, 0.0)}, "radius = 45.0: expected center + radius"),
        ({"layout": "disk", "radius": math.nan}, "radius = nan: expected a finite number >= 0"),
        ({"layout": "disk", "radios": 1.0}, "scenario: unknown field 'radios'"),
        ({"layout": "disk", "ue_positions": [(0, 0)]}, "ue_positions = .*: expected none"),
        ({"layout": "disc"}, r"layout = 'disc': expected one of .* \(did you mean 'disk'\?\)"),
        (
            {"layout": "clusters", "spread": 86.0},
            "spread = 86.0: expected center + spread + cluster",
        ),
        ({"layout": "clusters", "sizes": []}, "sizes = .*: expected the numbers of UEs of one"),
        ({"layout": "clusters", "sizes": [10**6, 1]}, "sizes = .*: expected at most 1000000 UEs"),
        ({"layout": "clusters", "sizes": [3, 4], "num_ues": 8}, "num_ues = 8: expected 7, as"),
        ({"layout": "random_layout", "seed": 1.5}, "seed = 1.5: expected a whole number >= 0"),
        (
            {
                "layout": "random_layout",
                "map_side": 80.0,
                "eavesdropper_positions": (40.0, 40.0),
                "helper_starts": (-40.0, -40.0),
            },
            "map_side = 80.0: expected at least 90 m for this layout",
        ),
    ],
)
def test_a_layout_that_cannot_be_drawn_is_refused(fields: dict[str, Any], line: str) -> None:
    with pytest.raises(InputError, match=f"^{line.replace(' + ', r' [+] ')}") as caught:
        drawn_scenario(fields)
    assert "\n" not in str(caught.value)
