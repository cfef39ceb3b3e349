"""What a slot earns: a function of its outcome, or a TorchRL transform, and what is known of it."""

import inspect
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, SupportsIndex, TypeAlias

import torch
from torch import Tensor
from torchrl.envs import Compose, Transform

from hyuav._support.errors import InputError, InputTypeError, rejection, require_choice
from hyuav._support.registry import failure
from hyuav.physics.outcome import Control, SlotOutcome
from hyuav.physics.scenario import Scenario
from hyuav.physics.slot import Physics, slot
from hyuav.physics.tasks import mean_tasks

POSITION, VELOCITY, EPISODE = DEPENDENCES = ("position", "velocity", "episode")
"""What the expected reward of a slot depends on: where the helper is; that and how it flew there;
or what the episode brought before, so that it does not add up over slots."""

Source: TypeAlias = Callable[[SlotOutcome], Tensor] | Transform | type[Transform]

ENTRIES = {
    "sum_rate": "slot",
    "secrecy_rate": "ue",
    "offloading": "ue",
    "offloading_rate": "ue",
    "flight_energy": "helper",
    "helper_transmission_energy": "helper",
    "ue_transmission_energy": "ue",
}
"""What an environment can give of a slot's outcome, and of what there is a number for each."""

_PLACES = 7
"""In each direction, where a function is tried."""

FUNCTION = "a function of a slot's outcome that gives a tensor (..., 1) of finite numbers"


@dataclass(frozen=True)
class Reward:
    """What a slot earns, in place of the secrecy sum-rate.

    Args:
        source: a function that maps a :class:`hyuav.physics.outcome.SlotOutcome`, of any leading
            shape (...), to a tensor (..., 1) and depends on nothing else. Or a transform of TorchRL
            that changes ``reward``; a class of transforms is called with the scenario. What a
            transform names in ``in_keys`` is given by the environment, if it is one of
            :data:`ENTRIES`.
        name: in tables and in a run's configuration; the source's own where it is empty.
        unit: of the reward, for labels; empty where there is none.
        depends_on: one of :data:`DEPENDENCES`, which decides how an optimum is found. None lets it
            be found out: of a function, by what it reads of the outcome; a transform is taken to
            depend on the episode.

    Raises:
        InputError: (a ``ValueError``) another ``depends_on``.
        InputTypeError: (also a ``TypeError``) the source is neither.

    Example:
        >>> served = Reward(lambda slot: slot.offloading.float().mean(-1, keepdim=True), "served")
        >>> make_env("two_clusters", reward=served).rollout(20)["episode_reward"]
    """

    source: Source
    name: str = ""
    unit: str = ""
    depends_on: str | None = None
    reference: str | None = None
    """``FILE.py:NAME`` with the whole path, of one that a file holds."""

    def __post_init__(self) -> None:
        if not isinstance(self.source, Transform) and not callable(self.source):
            raise InputTypeError(rejection("reward", self.source, f"{FUNCTION}, or a transform"))
        if self.depends_on is not None:
            require_choice("reward.depends_on", self.depends_on, DEPENDENCES)
        if not self.name:
            owner = self.source if hasattr(self.source, "__name__") else type(self.source)
            object.__setattr__(self, "name", owner.__name__)

    @property
    def is_transform(self) -> bool:
        """Whether it is not a function of the slot alone."""
        kind = self.source if inspect.isclass(self.source) else type(self.source)
        return issubclass(kind, Transform)

    @property
    def in_brackets(self) -> str:
        """The unit as it stands behind a word; empty where there is none."""
        return f" ({self.unit})" if self.unit else ""

    def of(self, outcome: SlotOutcome) -> Tensor:
        """What slots (...) earn: (..., 1). A transform is asked nothing here."""
        earned: Tensor = self.source(outcome)
        return earned

    def transforms(self, scenario: Scenario) -> list[Transform]:
        """The transforms that it is made of, for one environment; none for a function.

        Raises:
            InputError: its class cannot be called with the scenario.
        """
        if not self.is_transform:
            return []
        if isinstance(self.source, Transform):
            own = self.source.clone()
        else:
            try:
                own = self.source(scenario)  # type: ignore[arg-type]
            except Exception as error:  # whichever the class raises
                accepted = f"a class of transforms that takes the scenario ({self.told(error)})"
                raise InputError(rejection("reward", self.name, accepted)) from error
        return list(own.transforms) if isinstance(own, Compose) else [own]

    def dependence(self, scenario: Scenario, device: torch.device | str | None = None) -> str:
        """Which of :data:`DEPENDENCES` it is; a function is tried out.

        Args:
            scenario: in which it is tried, all over the map, hovering and flying.
            device: of the tensors that it is given.

        Raises:
            InputError: the function fails, or gives something else than finite numbers (..., 1).
        """
        if self.is_transform:
            return self.depends_on or EPISODE
        outcome = _Watched(_tried(scenario, device))
        try:
            earned: Any = self.of(outcome)
        except Exception as error:  # whichever the function raises
            accepted = f"{FUNCTION} ({self.told(error)})"
            raise InputError(rejection("reward", self.name, accepted)) from error
        self.require_numbers(earned, outcome.sum_rate.shape)
        flown = not outcome.read.isdisjoint(("control", "off_map"))
        return self.depends_on or (VELOCITY if flown else POSITION)

    def require_numbers(self, earned: Any, shape: torch.Size) -> None:
        """Accept what it gave for slots that earn numbers of this shape.

        Raises:
            InputError: other numbers.
            InputTypeError: no tensor, or none of floating-point numbers.
        """
        if not isinstance(earned, Tensor) or not earned.is_floating_point():
            kind = str(earned.dtype) if isinstance(earned, Tensor) else type(earned).__name__
            raise InputTypeError(rejection("reward", self.name, f"{FUNCTION}, not {kind}"))
        if earned.shape != shape:
            found = f"{tuple(earned.shape)} where slots are {tuple(shape[:-1])}"
            raise InputError(rejection("reward", self.name, f"{FUNCTION}, not {found}"))
        if not bool(earned.isfinite().all()):
            example = earned[~earned.isfinite()].flatten()[0].item()
            raise InputError(rejection("reward", self.name, f"{FUNCTION}, not {example}"))

    def told(self, error: Exception) -> str:
        """What went wrong, and in which file and line."""
        try:
            file = inspect.getsourcefile(self.source)
        except TypeError:
            file = None
        return failure(error, Path(file or self.name))


class _Watched(SlotOutcome):
    """An outcome that remembers what is read of it."""

    read: set[str]

    def __new__(cls, outcome: SlotOutcome) -> "_Watched":
        watched = super().__new__(cls, *outcome)
        watched.read = set()
        return watched

    def __getattribute__(self, name: str) -> Any:
        if name in ("control", "off_map"):
            self.read.add(name)
        return super().__getattribute__(name)

    def __iter__(self) -> Iterator[Any]:
        self.read.add("control")  # among others
        return super().__iter__()

    def __getitem__(self, place: SupportsIndex | slice) -> Any:
        self.read.add("control")
        return super().__getitem__(place)


_Watched.__name__ = SlotOutcome.__name__  # in what Python says where a name is not there


def _tried(scenario: Scenario, device: torch.device | str | None) -> SlotOutcome:
    """Slots (2, P) all over the map without fading: hovering, and flying as fast as possible."""
    physics = Physics(scenario, device)
    axis = torch.linspace(-0.5, 0.5, _PLACES, device=physics.device) * scenario.map_side
    places = torch.cartesian_prod(axis, axis).unsqueeze(-2).expand(2, -1, 1, 2)
    velocity = torch.zeros_like(places)
    velocity[1] = scenario.max_speed
    tasks = None
    if physics.edge_can_saturate:
        tasks = type(own := mean_tasks(scenario))(*(each.to(physics.device) for each in own))
    nodes = physics.nodes._replace(helper=places)
    return slot(physics, nodes, Control(velocity), tasks=tasks)
