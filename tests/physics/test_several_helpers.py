"""Slots with several helpers and eavesdroppers: published values, and scalar loops."""

import dataclasses
from typing import Any

import pytest
import torch
from hypothesis import assume, given
from hypothesis import strategies as st

import reference
import worlds
from hyuav import Scenario
from hyuav.physics.modes import ModeRule, mode_vectors
from hyuav.physics.outcome import Control, SlotOutcome
from hyuav.physics.slot import Physics, slot
from hyuav.physics.tasks import draw_tasks, mean_tasks

TINY = 1e-9
TWO_CLUSTERS = dataclasses.replace(Scenario.preset("two_clusters"), fading=False)
CONTESTED = dataclasses.replace(Scenario.preset("contested"), fading=False)
TWO_EAVESDROPPERS = dataclasses.replace(Scenario.preset("two_eavesdroppers"), fading=False)


def hovering(scenario: Scenario, *helpers: tuple[float, float], **control: Any) -> SlotOutcome:
    """A slot without fading in which the helpers stay at (x, y) m, in double precision."""
    physics = Physics(dataclasses.replace(scenario, helper_starts=helpers), dtype=torch.float64)
    staying = Control(torch.zeros(len(helpers), 2, dtype=torch.float64), **control)
    tasks = mean_tasks(physics.scenario, torch.float64)
    return slot(physics, physics.nodes, staying, tasks=tasks)


def sums(outcome: SlotOutcome) -> list[tuple[Any, int]]:
    """What each of the modes brings, and how many UEs offload in it."""
    return [
        (pytest.approx(float(mode.sum_rate), abs=1e-6), int(mode.offloading.sum()))
        for mode in outcome.modes
    ]


@pytest.mark.parametrize(
    ("helpers", "expected"),
    [
        (((-40, 48), (44, -56)), {3: (1.737597, 9)}),
        (((93, 42), (-57, 9)), {2: (2.194773, 10), 3: (2.117269, 6)}),
        (((-46, 17), (-59, 7)), {3: (2.367387, 7)}),
        (((-40, 10), (20, -20), (90, 90)), {3: (3.365045, 10), 7: (2.983666, 10)}),
    ],
)
def test_the_sum_rates_of_two_clusters_by_the_modes_of_its_helpers(
    helpers: tuple[tuple[float, float], ...], expected: dict[int, tuple[float, int]]
) -> None:
    none = (0.0, 0)
    assert sums(hovering(TWO_CLUSTERS, *helpers)) == [
        expected.get(number, none) for number in range(2 ** len(helpers))
    ]


@pytest.mark.parametrize(
    ("helpers", "kind", "expected"),
    [
        (((-30, 20), (100, 100)), "independent", {1: (1.262877, 7)}),
        (((-30, 20), (100, 100)), "colluding", {1: (1.075813, 6)}),
        (((-47, 48), (40, -23)), "independent", {3: (0.408881, 3)}),
    ],
)
def test_the_sum_rates_of_two_clusters_with_two_eavesdroppers(
    helpers: tuple[tuple[float, float], ...], kind: str, expected: dict[int, tuple[float, int]]
) -> None:
    scenario = dataclasses.replace(TWO_EAVESDROPPERS, eavesdroppers=kind)
    none = (0.0, 0)
    found = sums(hovering(scenario, *helpers))
    assert found == [expected.get(number, none) for number in range(4)]


@pytest.mark.parametrize(
    ("helpers", "kind", "expected"),
    [
        (((-70, -60), (70, 70)), "independent", {0: (20.692400, 10)}),
        (((-70, -60), (70, 70)), "colluding", {0: (17.718201, 10)}),
        (((-60, -50), (60, 55)), "independent", {0: (21.772565, 10)}),
        (((-60, -50), (60, 55)), "colluding", {0: (19.045796, 10)}),
        (
            ((-90, -80), (90, 90)),
            "independent",
            {0: (11.410630, 10), 1: (1.387062, 5), 2: (1.123353, 5)},
        ),
    ],
)
def test_the_sum_rates_of_a_contested_layout(
    helpers: tuple[tuple[float, float], ...], kind: str, expected: dict[int, tuple[float, int]]
) -> None:
    found = hovering(dataclasses.replace(CONTESTED, eavesdroppers=kind), *helpers)
    for number, (sum_rate, offloading) in expected.items():
        assert float(found.modes[number].sum_rate) == pytest.approx(sum_rate, abs=1e-6)
        assert int(found.modes[number].offloading.sum()) == offloading


def test_each_ue_takes_its_own_way() -> None:
    found = hovering(TWO_CLUSTERS, (93, 42), (-57, 9))
    assert found.relays.tolist() == [False, True]
    through = [number for number, way in enumerate(found.way.tolist(), start=1) if way == 2]
    assert through == [3, 4, 6, 7]
    assert set(found.way.tolist()) == {0, 2}


def test_each_helper_has_its_own_power() -> None:
    power = torch.tensor([0.5, 1.0], dtype=torch.float64)
    found = hovering(TWO_CLUSTERS, (93, 42), (-57, 9), power=power)
    assert sums(found)[2] == (3.966434, 10)


def test_helpers_that_cannot_be_told_apart_are_as_one_for_a_relayed_ue() -> None:
    one, two = hovering(TWO_CLUSTERS, (-49, 6)), hovering(TWO_CLUSTERS, (-49, 6), (-49, 6))
    assert float(two.relay.sum_rate) == float(one.relay.sum_rate)
    assert set(two.relay.way.tolist()) == {1}  # type: ignore[union-attr]


@given(worlds.scenarios(several=True), st.data(), st.integers(0, 2**31))
def test_slots_are_those_of_scalar_loops(
    scenario: Scenario, data: st.DataObject, seed: int
) -> None:
    count = scenario.num_helpers
    places = [data.draw(worlds.helpers(scenario)) for _ in range(count)]
    shares = st.sampled_from([0.0, 1e-3, 0.5, 1.0])
    power = data.draw(st.lists(shares, min_size=count, max_size=count))
    letters = ["".join("r" if own else "j" for own in modes) for modes in mode_vectors(count)]
    scheme = data.draw(st.sampled_from(["hybrid", "relay", "jamming", *letters]))
    physics = Physics(scenario, dtype=torch.float64)
    generator = torch.Generator().manual_seed(seed)
    fading = physics.draw_fading((), generator)
    tasks = draw_tasks(scenario, (), generator, torch.float64)
    nodes = physics.nodes._replace(helper=torch.tensor(places, dtype=torch.float64))
    rule = ModeRule.of([scheme], count).each(torch.squeeze)
    staying = torch.zeros(count, 2, dtype=torch.float64)
    control = Control(staying, rule, torch.tensor(power, dtype=torch.float64))
    links = None if fading is None else physics.link_row.unflatten(fading)
    found = slot(physics, nodes, control, links, tasks)
    powers = None if fading is None else reference.as_list(fading)
    cycles = reference.as_list(tasks.cpu_cycles)
    expected = reference.slot(scenario, scheme, places, powers, cycles, power)
    assume(expected.margin > TINY)
    assert found.relays.tolist() == list(expected.modes)
    assert float(found.sum_rate) == nearly(expected.chosen.sum_rate)
    assert found.offloading.tolist() == expected.chosen.offloading
    assert found.secrecy_rate.tolist() == nearly(expected.chosen.secrecy_rate)
    for way, of_oracle, offloads in zip(
        found.way.tolist(), expected.chosen.ways, expected.chosen.offloading, strict=True
    ):
        assert way == of_oracle or not offloads
    for outcome, modes in zip(found.modes, mode_vectors(count), strict=True):
        assert float(outcome.sum_rate) == nearly(expected.by_modes[modes].sum_rate)
        assert outcome.offloading.tolist() == expected.by_modes[modes].offloading


def nearly(expected: Any) -> Any:
    """The same numbers, up to rounding."""
    return pytest.approx(expected, rel=1e-8, abs=1e-9)


@pytest.mark.parametrize(
    "places",
    [
        [(0.0, 0.0), (0.0, 0.0), (0.0, 0.0)],
        [(80.0, 80.0), (80.0, 80.0), (0.0, 0.0)],
        [(-10.0, 18.0), (-10.0, 18.0), (-10.0, 18.0)],
    ],
)
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_helpers_at_one_point_above_l_or_the_eavesdropper_have_finite_rates(
    places: list[tuple[float, float]], dtype: torch.dtype
) -> None:
    scenario = dataclasses.replace(
        TWO_CLUSTERS, helper_starts=tuple(places), eavesdropper_altitude=80.0
    )
    physics = Physics(scenario, dtype=dtype)
    found = slot(physics, physics.nodes, Control(torch.zeros(3, 2, dtype=dtype)))
    for mode in found.modes:
        assert bool(mode.secrecy_rate.isfinite().all())
        assert mode.secrecy_rate.dtype == dtype
