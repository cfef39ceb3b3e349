"""Achievable rates of the two modes (the paper's rate table) and the secrecy sum-rate (eq. 6)."""

import math
from collections.abc import Callable, Sequence
from functools import partial, reduce
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
        return spectral_efficiency(self.legitimate_snr, self.time_share)

    @property
    def eavesdropper(self) -> Tensor:
        """R^e_u: (..., U) bps/Hz."""
        return spectral_efficiency(self.eavesdropper_snr, self.time_share)


def spectral_efficiency(snr: Tensor, time_share: float = 1.0) -> Tensor:
    """log2(1 + SNR) in bps/Hz, accurate for small SNR too, in a share of the time."""
    return torch.log1p(snr) * (time_share / math.log(2.0))


class Sent(NamedTuple):
    """What all nodes send at, in units of the noise power sigma^2."""

    ue: Tensor
    """p_u / sigma^2: a number, as a tensor since PyTorch multiplies by one faster."""
    relay: Sequence[Tensor]
    """p_i / sigma^2 of each helper where it relays: H of (..., 1), or of all."""
    jamming: Sequence[Tensor]
    """p_j / sigma^2 of each helper where it jams, likewise."""

    def scaled(self, power: Sequence[Tensor]) -> "Sent":
        """With each helper's power (..., 1) in units of the nominal power of its mode."""
        relay, jamming = (
            [nominal * own for nominal, own in zip(of_mode, power, strict=True)]
            for of_mode in (self.relay, self.jamming)
        )
        return Sent(self.ue, relay, jamming)


def straight_rates(
    gains: Links, sent: Sent, jammers: Sequence[int], eavesdroppers: str
) -> AchievableRates:
    """Rates of UEs that send straight to the legitimate UAV, for their whole share of the slot.

    The jammers' noise reaches the eavesdroppers and the legitimate UAV.

    Args:
        gains: of the slot.
        sent: by all nodes.
        jammers: the helpers that jam, at least one, counted from 0.
        eavesdroppers: as for :func:`overheard`.
    """
    # A number over a tensor is the same, by way of Python.
    at_legitimate = _noise(sent, jammers, gains.to_legitimate).reciprocal() * sent.ue
    at_eavesdroppers = _noise(sent, jammers, gains.to_eavesdroppers).reciprocal() * sent.ue
    return AchievableRates(
        at_legitimate * gains.ue_legitimate,
        overheard(at_eavesdroppers.unsqueeze(-2) * gains.ue_eavesdropper, eavesdroppers),
        1.0,
    )


def relay_rates(
    gains: Links, sent: Sent, relay: int, jammers: Sequence[int], eavesdroppers: str
) -> AchievableRates:
    """Rates through a relay: decode-and-forward in two halves of the UE's share of the slot.

    Args:
        gains: of the slot.
        sent: by all nodes.
        relay: the helper that relays, counted from 0.
        jammers: the helpers that jam meanwhile.
        eavesdroppers: as for :func:`overheard`.
    """
    own = sent.relay[relay]
    combined = own * gains.to_legitimate(relay) + sent.ue * gains.ue_legitimate
    decoded = sent.ue * gains.ue_helper.select(-1, relay)
    heard = (own * gains.to_eavesdroppers(relay)).unsqueeze(-2) + sent.ue * gains.ue_eavesdropper
    if jammers:
        combined = combined / _noise(sent, jammers, gains.to_legitimate)
        decoded = decoded / _noise(sent, jammers, partial(gains.to_helper, relay))
        heard = heard / _noise(sent, jammers, gains.to_eavesdroppers).unsqueeze(-2)
    return AchievableRates(torch.minimum(combined, decoded), overheard(heard, eavesdroppers), 0.5)


def _noise(sent: Sent, jammers: Sequence[int], gain: Callable[[int], Tensor]) -> Tensor:
    """Noise and jamming in units of sigma^2, by the gains (..., k) of each jammer: (..., k)."""
    received = [sent.jamming[jammer] * gain(jammer) for jammer in jammers]
    return reduce(torch.add, received) + 1.0


def overheard(snr: Tensor, eavesdroppers: str) -> Tensor:
    """What the eavesdroppers make of what they receive: an SNR (..., U).

    Args:
        snr: of each of them, (..., U, E).
        eavesdroppers: "independent", where the best-placed one counts, or "colluding", where their
            SNRs add up.
    """
    if snr.shape[-1] == 1:
        return snr.squeeze(-1)
    return snr.sum(dim=-1) if eavesdroppers == "colluding" else snr.amax(dim=-1)


def secrecy_rate(rates: AchievableRates) -> Tensor:
    """[R^d_u - R^e_u]^+ of eq. 6: (..., U) bps/Hz.

    A difference of logarithms is the logarithm of a ratio: one is faster than two, and no digits
    cancel where both rates are large.
    """
    gap = (rates.legitimate_snr - rates.eavesdropper_snr).relu()
    return spectral_efficiency(gap / (1.0 + rates.eavesdropper_snr), rates.time_share)


def secrecy_sum_rate(secrecy_rate: Tensor, offloading: Tensor) -> Tensor:
    """C of eq. 6: the secrecy rates summed over the UEs that offload.

    Args:
        secrecy_rate: (..., U) bps/Hz.
        offloading: (..., U) bool, z_u.

    Returns:
        (...) bps/Hz.
    """
    return (secrecy_rate * offloading).sum(dim=-1)
