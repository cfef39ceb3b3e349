"""The scenario bound to the equations, compared to published numbers and to scalar loops."""

import dataclasses
from typing import Any

import pytest
import torch
from hypothesis import assume, example, given
from hypothesis import strategies as st

import reference
import worlds
from hyuav import Scenario
from hyuav.physics.energy import budget_speeds
from hyuav.physics.layout import Nodes
from hyuav.physics.modes import MODE_RULES, ModeRule
from hyuav.physics.outcome import Control
from hyuav.physics.slot import Geometry, Physics, slot
from hyuav.physics.tasks import Tasks, draw_tasks, mean_tasks
from reference import hover, with_helper

TINY = 1e-9
SEEDS = st.integers(0, 2**31)


def without_fading(name: str) -> Scenario:
    return dataclasses.replace(Scenario.preset(name), fading=False)


def double(scenario: Scenario) -> Physics:
    return Physics(scenario, dtype=torch.float64)


def geometry(physics: Physics, position: Any) -> Geometry:
    return physics.geometry(with_helper(physics, position))


def tasks_of(cycles: list[float]) -> Tasks:
    size = torch.tensor(cycles, dtype=torch.float64)
    return Tasks(size, torch.ones_like(size))


def nearly(rows: list[list[float]]) -> list[Any]:
    """Rows of numbers, to be compared with others up to rounding."""
    return [pytest.approx(row, rel=1e-12) for row in rows]


def random_slot(
    physics: Physics, seed: int
) -> tuple[torch.Tensor | None, Tasks, list[float] | None, list[float]]:
    """A slot's fading and tasks, as the physics and as the reference take them."""
    generator = torch.Generator().manual_seed(seed)
    fading = physics.draw_fading((), generator)
    tasks = draw_tasks(physics.scenario, (), generator, physics.dtype)
    powers = None if fading is None else reference.as_list(fading)
    return fading, tasks, powers, reference.as_list(tasks.cpu_cycles)


@pytest.mark.parametrize(
    ("layout", "helper", "relay", "relaying_ues", "jamming", "jamming_ues"),
    [
        ("random_disk", (-20, -20), 1.759638, 5, 0.0, 0),
        ("random_disk", (0, 0), 0.541016, 4, 0.0, 0),
        ("random_disk", (100, 100), 0.0, 0, 4.052183, 10),
        ("two_clusters", (-20, -20), 1.713314, 7, 0.0, 0),
        ("two_clusters", (-49, 6), 2.391039, 7, 0.0, 0),
        ("two_clusters", (80, 80), 0.0, 0, 2.714112, 10),
    ],
)
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_the_secrecy_sum_rates_of_both_layouts_without_fading(
    layout: str,
    helper: tuple[int, int],
    relay: float,
    relaying_ues: int,
    jamming: float,
    jamming_ues: int,
    dtype: torch.dtype,
) -> None:
    found = hover(Physics(without_fading(layout), dtype=dtype), helper)
    tolerance = 1e-6 if dtype == torch.float64 else 1e-5
    assert float(found.relay.sum_rate) == pytest.approx(relay, rel=tolerance)
    assert float(found.jamming.sum_rate) == pytest.approx(jamming, rel=tolerance)
    assert int(found.relay.offloading.sum()) == relaying_ues
    assert int(found.jamming.offloading.sum()) == jamming_ues
    assert bool(found.relays) == (relay > jamming)


def test_the_gains_of_the_first_ue_of_two_clusters() -> None:
    gains = geometry(double(without_fading("two_clusters")), [-40.0, -40.0]).gains
    values = [float(gain.flatten()[0]) for gain in gains[:5]]
    expected = [1.465416e-09, 9.377344e-10, 3.795931e-10, 3.125000e-08, 3.289474e-09]
    assert values == pytest.approx(expected, rel=1e-6)


@given(worlds.scenarios(), st.data())
def test_distances_are_to_the_ues_then_the_legitimate_then_the_eavesdropper_uav(
    scenario: Scenario, data: st.DataObject
) -> None:
    helper = data.draw(worlds.helpers(scenario))
    distances = geometry(double(scenario), helper).distances
    assert reference.as_list(distances) == pytest.approx(reference.distances(scenario, helper))


@given(worlds.scenarios(), st.data(), SEEDS)
def test_the_gains_are_those_of_scalar_loops(
    scenario: Scenario, data: st.DataObject, seed: int
) -> None:
    helper = data.draw(worlds.helpers(scenario))
    physics = double(scenario)
    fading, _, powers, _ = random_slot(physics, seed)
    links = None if fading is None else physics.link_row.unflatten(fading)
    found = geometry(physics, helper).gains.faded(links)
    expected = reference.gains(scenario, helper, powers)
    assert reference.as_list(found.ue_legitimate) == pytest.approx(expected.g_ul, rel=1e-12)
    assert found.ue_helper.tolist() == nearly(expected.g_uh)
    assert found.ue_eavesdropper.tolist() == nearly(expected.g_ue)
    assert reference.as_list(found.helper_legitimate) == pytest.approx(expected.g_hl, rel=1e-12)
    assert found.helper_eavesdropper.tolist() == nearly(expected.g_he)


@given(worlds.scenarios(), st.data(), SEEDS)
def test_both_modes_are_those_of_scalar_loops(
    scenario: Scenario, data: st.DataObject, seed: int
) -> None:
    helper = data.draw(worlds.helpers(scenario))
    physics = double(scenario)
    fading, tasks, powers, cycles = random_slot(physics, seed)
    found = hover(physics, helper, fading, tasks)
    for mode, outcome in ((reference.RELAY, found.relay), (reference.JAMMING, found.jamming)):
        expected = reference.outcome(scenario, helper, powers, cycles, mode)
        assume(expected.margin > TINY)
        assert outcome.offloading.tolist() == expected.offloading
        assert outcome.secrecy_rate.tolist() == pytest.approx(
            expected.secrecy_rate, rel=1e-9, abs=1e-9
        )
        assert float(outcome.sum_rate) == pytest.approx(expected.sum_rate, rel=1e-9, abs=1e-9)


@given(worlds.scenarios(), st.sampled_from(MODE_RULES), st.data())
def test_flights_are_those_of_scalar_loops(
    scenario: Scenario, scheme: str, data: st.DataObject
) -> None:
    start = data.draw(worlds.helpers(scenario))
    action = data.draw(worlds.actions())
    expected = reference.flight(scenario, scheme, start, action)
    assume(expected.margin > TINY)
    physics = double(scenario)
    limit = physics.norm_limit([scheme])
    velocity = physics.velocity(torch.tensor([action], dtype=torch.float64), limit)
    tasks = mean_tasks(scenario, torch.float64)
    flown = slot(physics, with_helper(physics, start), Control(velocity), None, tasks)
    assert flown.off_map.tolist() == [expected.off_map]
    assert flown.nodes.helper[0].tolist() == pytest.approx(expected.position, abs=1e-9)
    assert flown.control.velocity[0].tolist() == pytest.approx(expected.velocity, abs=1e-9)


@given(worlds.scenarios(fading=True), st.data(), SEEDS)
def test_positions_are_independent_of_the_batch_they_are_evaluated_in(
    scenario: Scenario, data: st.DataObject, seed: int
) -> None:
    points = st.lists(worlds.helpers(scenario), min_size=6, max_size=6)
    position = torch.tensor(data.draw(points), dtype=torch.float64)
    physics = double(scenario)
    generator = torch.Generator().manual_seed(seed)
    fading = physics.draw_fading((6,), generator)
    tasks = draw_tasks(scenario, (6,), generator, torch.float64)
    assert fading is not None
    together = hover(
        physics,
        position.reshape(2, 3, 2),
        fading.reshape(2, 3, -1),
        Tasks(*(part.reshape(2, 3, -1) for part in tasks)),
    )
    for row in range(6):
        alone = hover(physics, position[row], fading[row], Tasks(*(part[row] for part in tasks)))
        for batched, single in ((together.relay, alone.relay), (together.jamming, alone.jamming)):
            torch.testing.assert_close(batched.sum_rate.flatten()[row], single.sum_rate)


@given(worlds.scenarios(fading=False), st.data())
def test_a_layout_in_each_row_is_as_that_layout_alone(
    scenario: Scenario, data: st.DataObject
) -> None:
    half, count = scenario.map_side / 2, scenario.num_ues
    points = st.lists(worlds.coordinates(half), min_size=count + 3, max_size=count + 3)
    layouts = [data.draw(points) for _ in range(3)]
    rows = [
        dataclasses.replace(
            scenario,
            ue_positions=tuple(layout[3:]),
            legitimate_position=layout[0],
            helper_starts=(layout[1],),
            eavesdropper_positions=(layout[2],),
        )
        for layout in layouts
    ]
    staying = Control(torch.zeros(1, 2, dtype=torch.float64))
    tasks = mean_tasks(scenario, torch.float64)
    nodes = Nodes.in_rows([Nodes.of(row, dtype=torch.float64) for row in rows], 2)
    assert nodes.ue.shape == (3, 1, count, 2)
    together = slot(double(scenario), nodes, staying, None, tasks)
    for index, row in enumerate(rows):
        alone = slot(double(row), double(row).nodes, staying, None, tasks)
        assert torch.equal(together.distances[index, 0], alone.distances)
        for batched, single in ((together.relay, alone.relay), (together.jamming, alone.jamming)):
            assert torch.equal(batched.offloading[index, 0], single.offloading)
            torch.testing.assert_close(batched.sum_rate[index, 0], single.sum_rate)


@given(worlds.scenarios(), st.data(), st.floats(0.0, 1.0), SEEDS)
def test_power_is_in_units_of_the_modes_nominal_power(
    scenario: Scenario, data: st.DataObject, share: float, seed: int
) -> None:
    helper = data.draw(worlds.helpers(scenario))
    weaker = dataclasses.replace(
        scenario,
        relay_power=scenario.relay_power * share,
        jamming_power=scenario.jamming_power * share,
    )
    fading, tasks, _, _ = random_slot(double(scenario), seed)
    power = torch.tensor([share], dtype=torch.float64)
    found = hover(double(scenario), helper, fading, tasks, power=power)
    expected = hover(double(weaker), helper, fading, tasks)
    torch.testing.assert_close(found.relay.secrecy_rate, expected.relay.secrecy_rate)
    torch.testing.assert_close(found.jamming.secrecy_rate, expected.jamming.secrecy_rate)


def test_the_mode_rule_says_which_mode_counts() -> None:
    physics = double(without_fading("two_clusters"))
    at = [[-49.0, 6.0], [80.0, 80.0]]  # where relaying is better, and where jamming is
    relay, jamming = (getattr(hover(physics, at), mode).sum_rate for mode in ("relay", "jamming"))
    expected = {"hybrid": relay.maximum(jamming), "relay": relay, "jamming": jamming}
    for name in MODE_RULES:
        found = hover(physics, at, mode_rule=ModeRule.of([name], 1))
        assert torch.equal(found.sum_rate.squeeze(-1), expected[name])


def test_the_speed_that_the_budget_of_a_scheme_allows() -> None:
    scenario = dataclasses.replace(
        Scenario.preset("two_clusters"), helper_energy_budget=100.0, jamming_power=10.0
    )
    physics = double(scenario)
    for scheme, transmission in (("relay", 0.006), ("jamming", 10.0), ("hybrid", 10.0)):
        flight = 0.5 * 9.65 * budget_speeds(physics.scenario, scheme)[0] ** 2
        assert flight + transmission == pytest.approx(100.0)


def test_a_budget_below_the_transmission_energy_leaves_no_flight() -> None:
    scenario = dataclasses.replace(Scenario.preset("two_clusters"), helper_energy_budget=0.01)
    physics = double(scenario)
    assert budget_speeds(physics.scenario, "jamming")[0] == 0.0
    assert budget_speeds(physics.scenario, "relay")[0] > 0.0
    limit = physics.norm_limit(["jamming"])
    for action in (torch.ones(1, 2, dtype=torch.float64), torch.zeros(1, 2, dtype=torch.float64)):
        assert not physics.velocity(action, limit).any()


def test_the_papers_budgets_limit_neither_speed_nor_admission() -> None:
    physics = Physics(Scenario.preset("two_clusters"))
    assert physics.norm_limit(MODE_RULES) is None
    assert not physics.edge_can_saturate


def test_with_1024_bytes_in_a_kilobyte_the_budgets_would_not_hold() -> None:
    scenario = dataclasses.replace(
        Scenario.preset("two_clusters"), task_size=(20 * 1024 * 8, 30 * 1024 * 8)
    )
    assert Physics(scenario).edge_can_saturate


@pytest.mark.parametrize("beyond", [-1e-3, 1e-3])
def test_the_edge_can_saturate_exactly_where_all_largest_tasks_exceed_its_budget(
    beyond: float,
) -> None:
    worst = 1e-27 * (10 * 240e3 * 1200) ** 3
    scenario = dataclasses.replace(
        Scenario.preset("two_clusters"), edge_energy_budget=worst * (1 + beyond)
    )
    assert Physics(scenario).edge_can_saturate == (beyond < 0)


@given(
    st.lists(st.floats(1e8, 2.88e8), min_size=10, max_size=10),
    st.floats(1e-3, 30.0),
    SEEDS,
)
@example([2.88e8] * 10, 24.0, 0)
def test_the_edge_admits_the_best_secrecy_rates_first_and_stays_within_its_budget(
    cycles: list[float], budget: float, seed: int
) -> None:
    scenario = dataclasses.replace(Scenario.preset("random_disk"), edge_energy_budget=budget)
    physics = double(scenario)
    fading = physics.draw_fading((), torch.Generator().manual_seed(seed))
    free = double(dataclasses.replace(scenario, edge_energy_budget=1e30))
    unlimited = hover(free, [80.0, 80.0], fading).jamming
    admitted = hover(physics, [80.0, 80.0], fading, tasks_of(cycles)).jamming
    load = sum(c for c, z in zip(cycles, admitted.offloading.tolist(), strict=True) if z)
    assert 1e-27 * load**3 <= budget * (1 + 1e-9)
    left_out = unlimited.offloading & ~admitted.offloading
    assert not (admitted.offloading & ~unlimited.offloading).any()
    if left_out.any():
        best_left_out = unlimited.secrecy_rate[left_out].max()
        assert (unlimited.secrecy_rate[admitted.offloading] >= best_left_out).all()
        next_in_line = int(torch.where(left_out, unlimited.secrecy_rate, -1.0).argmax())
        assert 1e-27 * (load + cycles[next_in_line]) ** 3 > budget * (1 - 1e-9)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
@pytest.mark.parametrize(
    ("case", "changes"),
    [
        ("helper above L", {}),
        ("all UEs on one point", {"ue_positions": [(5.0, 5.0)] * 10}),
        ("all UEs below L", {"ue_positions": [(0.0, 0.0)] * 3}),
        ("E above L", {"eavesdropper_positions": (0.0, 0.0)}),
        ("E at L", {"eavesdropper_positions": (0.0, 0.0), "eavesdropper_altitude": 80.0}),
        ("E at the helper's altitude", {"eavesdropper_altitude": 80.0}),
        ("one UE", {"ue_positions": [(1.0, 2.0)]}),
        ("1000 UEs", {"ue_positions": [(i / 25, -i / 50) for i in range(1000)]}),
        ("no UE power", {"ue_power": 0.0}),
        ("no helper power", {"relay_power": 0.0, "jamming_power": 0.0}),
        ("no path gain", {"ground_to_air_gain": 0.0, "air_to_air_gain": 0.0}),
        ("no coverage", {"coverage_radius": 0.0}),
        ("very low altitude", {"altitude": 1e-6, "eavesdropper_altitude": 1e-6}),
        ("pure scatter", {"ground_to_air_k_factor": -100.0, "air_to_air_k_factor": -100.0}),
        ("pure line of sight", {"ground_to_air_k_factor": 100.0, "air_to_air_k_factor": 100.0}),
    ],
)
def test_degenerate_worlds_have_finite_rates(
    case: str, changes: dict[str, Any], dtype: torch.dtype
) -> None:
    scenario = dataclasses.replace(Scenario.preset("two_clusters"), **changes)
    physics = Physics(scenario, dtype=dtype)
    position = torch.tensor([[0.0, 0.0], [80.0, 80.0], [100.0, -100.0], [5.0, 5.0]], dtype=dtype)
    generator = torch.Generator().manual_seed(0)
    fading = physics.draw_fading((4,), generator)
    tasks = draw_tasks(scenario, (4,), generator, dtype)
    found = hover(physics, position, fading, tasks)
    for rate in (found.relay.sum_rate, found.jamming.sum_rate):
        assert rate.shape == (4,), case
        assert rate.dtype == dtype, case
        assert bool(rate.isfinite().all()), case
        assert bool((rate >= 0).all()), case


@pytest.mark.parametrize("layout", ["random_disk", "two_clusters"])
def test_sum_rates_are_differentiable_in_the_position(layout: str) -> None:
    physics = double(without_fading(layout))
    # Away from the points where a UE starts or stops to offload.
    position = torch.tensor([[-22.0, -19.0], [90.0, 85.0]], dtype=torch.float64, requires_grad=True)

    def sum_rates(position: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        found = hover(physics, position)
        return found.relay.sum_rate, found.jamming.sum_rate

    assert torch.autograd.gradcheck(sum_rates, (position,))
    relay, jamming = sum_rates(position)
    slope = torch.autograd.grad(relay.sum() + jamming.sum(), position)[0]
    assert bool((slope.norm(dim=-1) > 1e-6).all())


def test_single_and_double_precision_agree() -> None:
    scenario = Scenario.preset("random_disk")
    exact, rounded = double(scenario), Physics(scenario)
    generator = torch.Generator().manual_seed(5)
    position = 200 * torch.rand(4000, 2, generator=generator, dtype=torch.float64) - 100
    fading = exact.draw_fading((4000,), generator)
    assert fading is not None
    precise, coarse = hover(exact, position, fading), hover(rounded, position, fading.float())
    for expected, found in (
        (precise.relay.sum_rate, coarse.relay.sum_rate),
        (precise.jamming.sum_rate, coarse.jamming.sum_rate),
    ):
        assert found.dtype == torch.float32
        close = (found - expected).abs() < 1e-4
        # A UE at the very threshold may fall on the other side: that moves C by epsilon.
        assert int((~close).sum()) <= 2


@pytest.mark.parametrize("exponent", [0.0, 1.7, 2.0, 2.8, 4.0])
def test_the_path_loss_exponent_of_the_ues_links_is_that_of_scalar_loops(exponent: float) -> None:
    scenario = dataclasses.replace(
        without_fading("two_clusters"), ground_to_air_exponent=exponent, ground_to_air_gain=1e-4
    )
    physics, helper = double(scenario), (-49.0, 6.0)
    found, expected = geometry(physics, helper).gains, reference.gains(scenario, helper, None)
    assert reference.as_list(found.ue_legitimate) == pytest.approx(expected.g_ul, rel=1e-12)
    assert found.ue_helper.tolist() == nearly(expected.g_uh)
    assert found.ue_eavesdropper.tolist() == nearly(expected.g_ue)
    assert reference.as_list(found.helper_legitimate) == pytest.approx(expected.g_hl, rel=1e-12)
    assert Scenario.preset("two_clusters").ground_to_air_exponent == 2.0


def test_a_helper_above_l_receives_the_gain_at_the_reference_distance() -> None:
    physics = double(without_fading("two_clusters"))
    at = [[x, 0.0] for x in (0.0, 0.5, 1.0, 2.0)]
    gains = geometry(physics, at).gains.helper_legitimate.flatten().tolist()
    assert gains == pytest.approx([1e-4, 1e-4, 1e-4, 2.5e-5])


def test_rates_that_a_full_edge_server_would_lower_are_not_given_without_tasks() -> None:
    scenario = dataclasses.replace(without_fading("random_disk"), edge_energy_budget=1.0)
    physics, position = double(scenario), [80.0, 80.0]
    assert physics.edge_can_saturate
    with pytest.raises(ValueError, match=r"^tasks: expected"):
        hover(physics, position)
    admitted = hover(physics, position, tasks=mean_tasks(scenario, torch.float64)).jamming
    unlimited = hover(double(without_fading("random_disk")), position).jamming
    assert 0.0 < float(admitted.sum_rate) < float(unlimited.sum_rate)
