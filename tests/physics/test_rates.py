"""Achievable rates in both modes and the secrecy rate."""

import math
from collections.abc import Callable

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

import reference
from hyuav import Scenario
from hyuav.physics import rates as secrecy
from hyuav.physics.channel import LinkRow, Links
from hyuav.physics.rates import AchievableRates, Sent

GAIN = st.floats(-14.0, -2.0).map(lambda exponent: 10.0**exponent)
SNR = st.floats(-6.0, 6.0).map(lambda exponent: 10.0**exponent)
POWER = st.floats(-5.0, 1.0).map(lambda exponent: 10.0**exponent)

# The first UE of two_clusters with the helper at (-40, -40).
FIRST_UE = (1.465416e-09, 9.377344e-10, 3.795931e-10, 3.125e-08, 3.289474e-09)


def both(rates: AchievableRates) -> tuple[torch.Tensor, torch.Tensor]:
    return rates.legitimate, rates.eavesdropper


def gains_of(*values: float, dtype: torch.dtype = torch.float64) -> Links:
    """Of one UE, one helper and one eavesdropper."""
    row = torch.tensor(values, dtype=dtype)
    return LinkRow(1, 1, 1).unflatten(row)


def sent(gains: Links, ue: float, helper: float, noise: float) -> Sent:
    """At powers in W, whatever the helper does."""
    own, of_helper = (gains.ue_legitimate.new_tensor(power / noise) for power in (ue, helper))
    return Sent(own, [of_helper], [of_helper])


def relaying(gains: Links, ue: float, helper: float, noise: float) -> AchievableRates:
    """The rates through the one helper, at powers in W."""
    return secrecy.relay_rates(gains, sent(gains, ue, helper, noise), 0, [], "independent")


def jamming(gains: Links, ue: float, helper: float, noise: float) -> AchievableRates:
    """The rates of the straight links while the one helper jams, at powers in W."""
    return secrecy.straight_rates(gains, sent(gains, ue, helper, noise), [0], "independent")


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_the_rates_of_the_first_ue_of_two_clusters(dtype: torch.dtype) -> None:
    gains = gains_of(*FIRST_UE, dtype=dtype)
    relay = relaying(gains, 0.1, 0.012, 1e-13)
    straight = jamming(gains, 0.1, 0.08, 1e-13)
    found = [float(rate) for rates in (relay, straight) for rate in both(rates)]
    assert found == pytest.approx([4.937287, 4.799333, 0.082177, 0.194327], rel=5e-6)
    assert {rate.dtype for rates in (relay, straight) for rate in both(rates)} == {dtype}


@given(st.tuples(GAIN, GAIN, GAIN, GAIN, GAIN), POWER, POWER, st.floats(-16.0, -9.0))
def test_the_rates_are_those_of_the_rate_table(
    values: tuple[float, float, float, float, float],
    ue_power: float,
    helper_power: float,
    noise_exponent: float,
) -> None:
    noise = 10.0**noise_exponent
    scenario = Scenario(
        ue_positions=((0.0, 0.0),),
        ue_power=ue_power,
        relay_power=helper_power,
        jamming_power=helper_power,
        noise_power=noise,
    )
    expected_gains = reference.Gains(
        [values[0]], [[values[1]]], [[values[2]]], [values[3]], [[values[4]]], {}
    )
    gains = gains_of(*values)
    for mode, way, found in (
        (reference.RELAY, 1, relaying(gains, ue_power, helper_power, noise)),
        (reference.JAMMING, reference.STRAIGHT, jamming(gains, ue_power, helper_power, noise)),
    ):
        expected = reference.rates(scenario, expected_gains, 0, mode, way)
        assert [float(rate) for rate in both(found)] == pytest.approx(expected, rel=1e-9, abs=1e-14)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_a_tiny_signal_has_a_rate_proportional_to_its_snr(dtype: torch.dtype) -> None:
    snr = torch.tensor([0.0, 1e-12, 1e-20, 1.0], dtype=dtype)
    expected = [0.0, 1e-12 / math.log(2), 1e-20 / math.log(2), 1.0]
    assert secrecy.spectral_efficiency(snr).tolist() == pytest.approx(expected, rel=1e-6)


def test_a_helper_that_cannot_decode_cannot_relay() -> None:
    deaf = gains_of(1e-9, 0.0, 1e-10, 1e-8, 1e-9)
    assert float(relaying(deaf, 0.1, 0.012, 1e-13).legitimate) == 0.0


def test_a_silent_helper_leaves_the_direct_link_at_half_and_at_full_rate() -> None:
    gains = gains_of(1e-9, 1e-3, 1e-10, 1e-8, 1e-9)
    relay = relaying(gains, 0.1, 0.0, 1e-13)
    straight = jamming(gains, 0.1, 0.0, 1e-13)
    assert float(straight.legitimate) == pytest.approx(math.log2(1 + 1e-10 / 1e-13))
    assert float(straight.eavesdropper) == pytest.approx(math.log2(1 + 1e-11 / 1e-13))
    assert float(relay.legitimate) == pytest.approx(float(straight.legitimate) / 2)
    assert float(relay.eavesdropper) == pytest.approx(float(straight.eavesdropper) / 2)


def test_without_transmit_power_there_is_no_rate() -> None:
    for rates in (
        relaying(gains_of(*FIRST_UE), 0.0, 0.0, 1e-13),
        jamming(gains_of(*FIRST_UE), 0.0, 0.0, 1e-13),
    ):
        assert [float(rate) for rate in both(rates)] == [0.0, 0.0]


@pytest.mark.parametrize("power", [1e-4, 0.08, 3.0])
def test_jamming_hurts_the_receiver_it_reaches_better(power: float) -> None:
    near_e = gains_of(1e-9, 1e-9, 1e-9, 1e-9, 1e-6)
    near_l = gains_of(1e-9, 1e-9, 1e-9, 1e-6, 1e-9)
    rates = jamming(near_e, 0.1, power, 1e-13)
    assert float(rates.legitimate) > float(rates.eavesdropper)
    rates = jamming(near_l, 0.1, power, 1e-13)
    assert float(rates.legitimate) < float(rates.eavesdropper)


def test_the_secrecy_rate_is_never_negative() -> None:
    rates = AchievableRates(torch.tensor([7.0, 1.0, 3.0]), torch.tensor([1.0, 7.0, 3.0]), 1.0)
    assert secrecy.secrecy_rate(rates).tolist() == [2.0, 0.0, 0.0]


@given(SNR, SNR, st.sampled_from([0.5, 1.0]))
def test_the_secrecy_rate_is_the_difference_of_the_rates(
    legitimate: float, eavesdropper: float, time_share: float
) -> None:
    snrs = torch.tensor([[legitimate], [eavesdropper]], dtype=torch.float64)
    rates = AchievableRates(snrs[0], snrs[1], time_share)
    difference = float(rates.legitimate - rates.eavesdropper)
    found = float(secrecy.secrecy_rate(rates))
    assert found == pytest.approx(max(difference, 0.0), rel=1e-9, abs=1e-12)


def test_two_strong_signals_differ_exactly_in_float32() -> None:
    rates = AchievableRates(torch.tensor(1.0e9 + 64.0), torch.tensor(1.0e9), 1.0)
    assert float(secrecy.secrecy_rate(rates)) == pytest.approx(64e-9 / math.log(2), rel=1e-3)


def test_only_offloading_ues_add_to_the_secrecy_sum_rate() -> None:
    rate = torch.tensor([[1.0, 2.0, 4.0], [8.0, 16.0, 32.0]])
    offloading = torch.tensor([[True, False, True], [False, False, False]])
    assert secrecy.secrecy_sum_rate(rate, offloading).tolist() == [5.0, 0.0]


@pytest.mark.parametrize("mode", [relaying, jamming])
def test_rates_are_differentiable_in_every_gain(mode: Callable[..., AchievableRates]) -> None:
    # In units where gains are of order one; noise follows.
    values = [gain.requires_grad_() for gain in gains_of(2, 3, 5, 7, 11)[:5]]

    def rates(*gains: torch.Tensor) -> tuple[torch.Tensor, ...]:
        return both(mode(Links(*(*gains, torch.empty(0))), 1.3, 0.7, 0.5))

    assert torch.autograd.gradcheck(rates, values)


def test_one_helper_gain_serves_all_ues_of_a_batch() -> None:
    gains = Links(
        torch.full((10,), 1e-9),
        torch.full((4, 3, 10, 1), 1e-9),
        torch.full((10, 1), 1e-10),
        torch.full((4, 3, 1), 1e-8),
        torch.full((4, 3, 1, 1), 1e-8),
        torch.empty(4, 3, 0),
    )
    assert relaying(gains, 0.1, 0.01, 1e-13).legitimate.shape == (4, 3, 10)
    assert jamming(gains, 0.1, 0.01, 1e-13).legitimate.shape == (4, 3, 10)
