"""Achievable rates of the two modes (the paper's rate table) and the secrecy sum-rate (eq. 6)."""

import math
from typing import NamedTuple

import torch
from torch import Tensor

from hyuav.physics.channel import Links


class AchievableRates(NamedTuple):
    """What the legitimate and the eavesdropper UAV can receive."""

    legitimate_snr: Tensor
    """(..., U), at the end of the link that decides."""
    eavesdropper_snr: Tensor
    """(..., U)."""
    time_share: float
    """Of the UE's share of the slot in which the UE itself sends."""

    @property
    def legitimate(self) -> Tensor:
        """R^d_u: (..., U) bps/Hz."""
        return self.time_share * spectral_efficiency(self.legitimate_snr)

    @property
    def eavesdropper(self) -> Tensor:
        """R^e_u: (..., U) bps/Hz."""
        return self.time_share * spectral_efficiency(self.eavesdropper_snr)


def spectral_efficiency(snr: Tensor) -> Tensor:
    """log2(1 + SNR) in bps/Hz, accurate for small SNR too."""
    return torch.log1p(snr) * (1.0 / math.log(2.0))


def relay_rates(
    gains: Links, ue_power: float, relay_power: Tensor | float, noise_power: float
) -> AchievableRates:
    """Rates in relay mode: decode-and-forward in two halves of the UE's share of the slot.

    Args:
        gains: of the slot, with one helper and one eavesdropper.
        ue_power: p_u in W.
        relay_power: p_R in W, (..., H) or of all.
        noise_power: sigma^2 in W.
    """
    ue_snr, relay_snr = ue_power / noise_power, relay_power / noise_power
    combined = relay_snr * gains.helper_legitimate + ue_snr * gains.ue_legitimate
    decoded = ue_snr * gains.ue_helper.squeeze(-1)
    heard_from_helper = relay_snr * gains.helper_eavesdropper.squeeze(-1)
    overheard = heard_from_helper + ue_snr * gains.ue_eavesdropper.squeeze(-1)
    return AchievableRates(torch.minimum(combined, decoded), overheard, 0.5)


def jamming_rates(
    gains: Links, ue_power: float, jamming_power: Tensor | float, noise_power: float
) -> AchievableRates:
    """Rates in jamming mode: the helper's noise reaches the eavesdropper and the legitimate UAV.

    Args:
        gains: of the slot, with one helper and one eavesdropper.
        ue_power: p_u in W.
        jamming_power: p_J in W, (..., H) or of all.
        noise_power: sigma^2 in W.
    """
    ue_snr, jamming_snr = ue_power / noise_power, jamming_power / noise_power
    at_legitimate = ue_snr / (jamming_snr * gains.helper_legitimate + 1.0)
    at_eavesdropper = ue_snr / (jamming_snr * gains.helper_eavesdropper.squeeze(-1) + 1.0)
    return AchievableRates(
        at_legitimate * gains.ue_legitimate,
        at_eavesdropper * gains.ue_eavesdropper.squeeze(-1),
        1.0,
    )


def secrecy_rate(rates: AchievableRates) -> Tensor:
    """[R^d_u - R^e_u]^+ of eq. 6: (..., U) bps/Hz.

    A difference of logarithms is the logarithm of a ratio: one is faster than two, and no digits
    cancel where both rates are large.
    """
    gap = (rates.legitimate_snr - rates.eavesdropper_snr).clamp(min=0.0)
    return rates.time_share * spectral_efficiency(gap / (1.0 + rates.eavesdropper_snr))


def secrecy_sum_rate(secrecy_rate: Tensor, offloading: Tensor) -> Tensor:
    """C of eq. 6: the secrecy rates summed over the UEs that offload.

    Args:
        secrecy_rate: (..., U) bps/Hz.
        offloading: (..., U) bool, z_u.

    Returns:
        (...) bps/Hz.
    """
    return (secrecy_rate * offloading).sum(dim=-1)
