"""What keeps a mode from ever earning anything, told before it is flown."""

import math
import warnings
from collections.abc import Iterator

from torch import Tensor

from hyuav._support.errors import ScenarioWarning
from hyuav.physics.energy import edge_energy, offloading_energy
from hyuav.physics.scenario import Scenario

_told: set[str] = set()
"""Lines of this process, so that further learners and environments do not repeat them."""


def warn_of_what_cannot_earn(scenario: Scenario, ue_to_legitimate: Tensor | None) -> None:
    """Warn of each budget that forbids a mode to every UE, and where L covers none of them.

    A process tells a line once, however often what it says is flown.

    Args:
        scenario: whose budgets and coverage are looked at.
        ue_to_legitimate: D_{u,L}, (..., U) m; None where it is not known before the flight.

    Warns:
        ScenarioWarning: a line with the field, its value and what would be needed.
    """
    lines = [*_ue_budget(scenario), *_edge_budget(scenario)]
    if ue_to_legitimate is not None:
        lines += _coverage(scenario, ue_to_legitimate)
    for line in lines:
        if line not in _told:
            _told.add(line)
            warnings.warn(line, ScenarioWarning, stacklevel=3)


def _ue_budget(scenario: Scenario) -> Iterator[str]:
    """Eq. 8e, which is the same for all UEs and slots."""
    budget, num_ues = scenario.ue_energy_budget, scenario.num_ues
    spent = {
        mode: offloading_energy(
            scenario.ue_power, scenario.slot_duration, num_ues, relay=mode == "relaying"
        )
        for mode in ("relaying", "jamming")
    }
    forbidden = {mode: joules for mode, joules in spent.items() if joules > budget}
    if not forbidden:
        return
    joules = " and ".join(f"{own:g} J" for own in forbidden.values())
    instead = ""
    if budget > 0.0:
        enough = (str(math.ceil(num_ues * own / budget)) for own in forbidden.values())
        instead = f", or {' and '.join(enough)} UEs to share a slot,"
    yield (
        f"ue_energy_budget = {budget:g} J: with {num_ues} UE{'s' * (num_ues > 1)}, "
        f"{' and '.join(forbidden)} can earn nothing, since sending through such a slot takes a UE "
        f"{joules}; that much{instead} would do"
    )


def _edge_budget(scenario: Scenario) -> Iterator[str]:
    """Eq. 8f for the smallest task of a single UE."""
    budget = scenario.edge_energy_budget
    spent = edge_energy(scenario, scenario.task_size[0] * scenario.cycles_per_bit[0])
    if spent > budget:
        yield (
            f"edge_energy_budget = {budget:g} J: nothing can be earned, since computing the "
            f"smallest task of a single UE takes {spent:g} J; that much would do"
        )


def _coverage(scenario: Scenario, ue_to_legitimate: Tensor) -> Iterator[str]:
    """Eq. 5, by which only UEs within D_max of L offload, in both modes."""
    radius, nearest = scenario.coverage_radius, ue_to_legitimate.amin(dim=-1).flatten().cpu()
    uncovered, layouts = int((nearest > radius).sum()), len(nearest)
    if uncovered:
        where = f" in {uncovered} of {layouts} layouts" if layouts > 1 else ""
        yield (
            f"coverage_radius = {radius:g} m: nothing can be earned{where}, since L covers no UE; "
            f"it is {float(nearest.max()):g} m away from the nearest"
        )
