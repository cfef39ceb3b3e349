import dataclasses

from hyuav import Scenario
from hyuav.experiments.schemes import LEARNED, LEARNED_AS_IN_PAPER, OPTIMA, SCHEMES
from hyuav.physics.modes import MODE_RULES


def test_every_mode_rule_is_learned_twice_and_has_an_optimum() -> None:
    for schemes in (LEARNED, LEARNED_AS_IN_PAPER, OPTIMA):
        assert set(schemes) == set(MODE_RULES)
        assert all(SCHEMES[name].mode_rule == rule for rule, name in schemes.items())


def test_a_scheme_is_measured_against_the_optimum_of_its_mode_rule() -> None:
    assert {name: scheme.optimum for name, scheme in SCHEMES.items()} == {
        **dict.fromkeys(("proposed", "proposed_paper", "generalist", "optimum"), "optimum"),
        **{
            f"{rule}_{own}": f"{rule}_optimum"
            for rule in ("ja", "re")
            for own in ("ot", "ot_paper", "lt", "generalist", "optimum")
        },
        **dict.fromkeys(("proposed_power", "optimum_power"), "optimum_power"),
        "no_helper": None,
    }


def test_a_scheme_is_flown_in_the_scenario_but_for_what_it_changes() -> None:
    scenario = Scenario.preset("random_disk")
    for name in ("proposed", "re_lt", "optimum"):
        assert SCHEMES[name].flown_in(scenario) == scenario
    silent = SCHEMES["no_helper"].flown_in(scenario)
    assert silent == dataclasses.replace(scenario, jamming_power=0.0)
    controlled = SCHEMES["optimum_power"].flown_in(scenario)
    assert controlled == dataclasses.replace(scenario, power_control=True)
