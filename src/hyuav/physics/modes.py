"""In which modes the helpers work: the argmax of Algorithm 1, over all that they can do."""

from collections.abc import Callable, Sequence
from functools import cache
from typing import Annotated, NamedTuple

import torch
from torch import Tensor

from hyuav._support.errors import InputError, rejection, require_choice
from hyuav._support.parameters import OneOf


@cache
def mode_vectors(num_helpers: int) -> tuple[tuple[bool, ...], ...]:
    """All modes (k_1, ..., k_H) of the helpers, True where one relays, by sum_i k_i 2^(i - 1)."""
    return tuple(
        tuple(bool(number >> helper & 1) for helper in range(num_helpers))
        for number in range(2**num_helpers)
    )


class ModeRule(NamedTuple):
    """Which modes may be chosen, of those that :func:`mode_vectors` lists; by default any."""

    allowed: tuple[Tensor, ...] | None = None
    """Whether each of them may be chosen at all: 2^H of (..., 1) bool, or None where all may."""
    forced: tuple[Tensor, ...] = ()
    """Whether each of them is the first that may be, likewise."""

    @classmethod
    def of(
        cls, names: Sequence[str], num_helpers: int, device: torch.device | str | None = None
    ) -> "ModeRule":
        """The rules of these names, as :func:`fixed_modes` reads them: flags (len(names), 1)."""
        modes = mode_vectors(num_helpers)
        of_names = [allowed_vectors(name, num_helpers) for name in names]
        if all(own == modes for own in of_names):
            return cls()
        allowed = torch.tensor([[mode in own for mode in modes] for own in of_names], device="cpu")
        first = allowed & (allowed.cumsum(dim=-1) == 1)
        return cls(*(flags.to(device).split(1, dim=-1) for flags in (allowed, first)))

    def each(self, change: Callable[[Tensor], Tensor]) -> "ModeRule":
        """With flags of another shape."""
        if self.allowed is None:
            return self
        allowed, forced = (tuple(map(change, flags)) for flags in (self.allowed, self.forced))
        return ModeRule(allowed, forced)


MODE_RULES = ("hybrid", "relay", "jamming")
"""Who chooses the helpers' modes: the best of all in each slot, or always the same."""

ModeRuleName = Annotated[str, OneOf(*MODE_RULES)]

_LETTERS = {"r": True, "j": False}


def fixed_modes(mode_rule: str, num_helpers: int, name: str = "scheme") -> tuple[bool, ...] | None:
    """The modes that a rule prescribes, True where a helper relays; None where they are chosen.

    Args:
        mode_rule: a name of :data:`MODE_RULES`, or a letter for each helper, "r" where it relays
            and "j" where it jams.
        num_helpers: H.
        name: of what is refused.

    Raises:
        InputError: it is none of these.
    """
    if mode_rule == "hybrid":
        return None
    if mode_rule in MODE_RULES:
        return (mode_rule == "relay",) * num_helpers
    letters = [_LETTERS.get(letter) for letter in mode_rule] if isinstance(mode_rule, str) else []
    modes = tuple(relays for relays in letters if relays is not None)
    if len(modes) == len(letters) == num_helpers:
        return modes
    if num_helpers == 1:
        require_choice(name, mode_rule, MODE_RULES)
    letters_for_all = f"a letter r or j for each of {num_helpers} helpers"
    accepted = f"one of {', '.join(MODE_RULES)}, or {letters_for_all}"
    raise InputError(rejection(name, mode_rule, accepted))


def allowed_vectors(mode_rule: str, num_helpers: int) -> tuple[tuple[bool, ...], ...]:
    """The modes that a rule allows, in the order of :func:`mode_vectors`.

    Raises:
        InputError: as :func:`fixed_modes`.
    """
    fixed = fixed_modes(mode_rule, num_helpers)
    return mode_vectors(num_helpers) if fixed is None else (fixed,)


def beats(sum_rate: Tensor, best: Tensor, rule: ModeRule, mode: int) -> tuple[Tensor, Tensor]:
    """The argmax of Algorithm 1, one mode after the other.

    A mode is taken where its sum-rate is larger than the best of the modes before it, so that of
    equals the first is taken: a tie jams.

    Args:
        sum_rate: C_k of this mode, (..., 1) bps/Hz.
        best: the largest of the modes before it that are allowed, (..., 1) bps/Hz.
        rule: that decides which are.
        mode: the number of this one.

    Returns:
        where it is taken, (..., 1) bool, and the best with it, (..., 1) bps/Hz.
    """
    better = sum_rate > best
    if rule.allowed is None:
        return better, torch.maximum(sum_rate, best)
    taken = (better | rule.forced[mode]) & rule.allowed[mode]
    return taken, torch.where(taken, sum_rate, best)
