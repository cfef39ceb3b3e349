"""What a comparison covers: algorithms, scenarios, mode rules, horizons and seeds."""

import dataclasses
import itertools
import math
import re
from typing import Annotated, Any

from pydantic import Field
from pydantic.dataclasses import dataclass

from hyuav._support.errors import InputError, rejection, require_choice
from hyuav._support.machine import cores, require_installed
from hyuav._support.parameters import (
    Count,
    CountOrZero,
    Fraction,
    OneOf,
    OneOrMore,
    Parameters,
    Text,
    Threads,
    ZeroOrMore,
    parameter,
)
from hyuav._support.registry import is_reference
from hyuav.envs.rewards import REWARDS, SUM_RATE
from hyuav.experiments.comparison.ray import LOCAL
from hyuav.experiments.evaluation import EvaluationParameters
from hyuav.experiments.scenarios import NAMES, named_scenario
from hyuav.learning.algorithm import AlgorithmParameters
from hyuav.learning.ddpg import DDPG
from hyuav.learning.guide.parameters import OFF
from hyuav.learning.guide.robust import Robust
from hyuav.learning.learners import Learner
from hyuav.learning.registry import ALGORITHMS, BESIDE, PEER
from hyuav.learning.training import TrainingParameters
from hyuav.physics.layout import random_layout
from hyuav.physics.modes import MODE_RULES, ModeRuleName
from hyuav.physics.scenario import Scenario

ENTRIES = (*ALGORITHMS, *BESIDE)
"""What can be compared."""

PLAIN = {name: name.removesuffix("_robust") for name in ALGORITHMS}
"""The algorithm that each is a variant of."""


def _pieces(name: str) -> tuple[str, ...]:
    """What distinguishes a variant from the algorithm that it is a variant of."""
    own, plain = ALGORITHMS[name](), ALGORITHMS[PLAIN[name]]()
    differing = [
        field.name
        for field in dataclasses.fields(plain)
        if getattr(own, field.name) != getattr(plain, field.name)
    ]
    return (*differing, *(OFF if isinstance(own, Robust) else ()))


PIECES = tuple(dict.fromkeys(piece for name in ALGORITHMS for piece in _pieces(name)))
"""Hyperparameters in which a variant differs from the algorithm that it is a variant of, and the
pieces of its guide."""

ENGINES = ("processes", "ray")
"""What works the shards off."""

LAYOUT = "layout-"
"""With its seed behind, the name of a random layout's scenario."""

Entry = Annotated[Text, Field(description=f"one of {', '.join(ENTRIES)}, FILE.py:CLASS")]
Piece = Annotated[str, OneOf(*PIECES)]
ScenarioEntry = Annotated[Any, Field(description=f"one of {', '.join(NAMES)}, or its fields")]


@dataclass(frozen=True)
class Compare(Parameters):
    """What is compared, and how the work is divided."""

    algorithm: OneOrMore[Entry] = parameter(("ddpg", "ddpg_robust", "td3", "sac"))
    without: ZeroOrMore[Piece] = parameter(())
    """Pieces of a variant, such as ``clock``: it is compared once more for each, without it."""
    scenario: ZeroOrMore[ScenarioEntry] = parameter(("random_disk", "two_clusters"))
    """By name, or field by field, such as ``{layout: disk, num_ues: 12, seed: 3}``; what ``name``
    says is then its name, and its horizons are ``num_slots`` all the same."""
    layouts: Annotated[int, Field(ge=0, le=100_000)] = parameter(0)
    """Random layouts, besides the scenarios; see :func:`hyuav.physics.layout.random_layout`."""
    layouts_seed: CountOrZero = parameter(1000)
    """Of the first; the others follow."""
    scheme: OneOrMore[ModeRuleName] = parameter(MODE_RULES)
    num_slots: OneOrMore[Count] = parameter((10, 20), symbol="T")
    learners: Annotated[int, Field(ge=1, le=100_000)] = parameter(10)
    """Of each algorithm, scenario, mode rule and horizon; their seeds follow ``seed``."""
    seed: CountOrZero = parameter(0)
    reward: Text = parameter(SUM_RATE)
    """What a slot earns: a name, or FILE.py:NAME of a function that adds up over slots."""
    threshold: Fraction = parameter(0.97)
    """Share of the optimum that counts as solved."""
    shard_learners: Count = parameter(60)
    """The most learners that one worker trains side by side: about 0.7 GB of them (U = 10)."""
    engine: Annotated[str, OneOf(*ENGINES)] = parameter("processes")
    """What the workers are: processes of this machine, or those of Ray (extra ``cluster``)."""
    address: Text = parameter(LOCAL)
    """Of Ray: one that is started for the work, "auto" for one that runs here, or HOST:PORT."""
    workers: Threads = parameter(cores())
    """That train at the same time, by default as many as cores; one process is this one. A Ray
    that runs has its own."""
    retries: CountOrZero = parameter(2)
    """How often a piece of work is begun again whose worker was lost, killed perhaps."""
    output: Text = parameter("runs/${now:%Y-%m-%d_%H-%M-%S}_compare")
    """Directory of the comparison, which may have been begun."""

    def __post_init__(self) -> None:
        REWARDS.find(self.reward)
        for index, name in enumerate(self.algorithm):
            if is_reference(name):
                ALGORITHMS.find(name)
            place = f"algorithm[{index}]" if len(self.algorithm) > 1 else "algorithm"
            require_choice(place, name, [*ALGORITHMS.names(), *BESIDE])
        for name in ("algorithm", "without", "scheme", "num_slots"):
            values = getattr(self, name)
            if len(set(values)) < len(values):
                raise InputError(rejection(name, list(values), "values that differ"))
        varied = {entry.partition("-")[0] for entry in self.entries if "-" in entry}
        if len(varied) > 1:  # "without clock" would be a row of each
            accepted = f"one variant at a time, not {', '.join(sorted(varied))}"
            raise InputError(rejection("without", list(self.without), accepted))
        self._require_scenarios()

    def _require_scenarios(self) -> None:
        if not self.scenario and not self.layouts:
            accepted = "at least one scenario, or layouts >= 1"
            raise InputError(rejection("scenario", [], accepted))
        named = [named_scenario(entry) for entry in self.scenario]
        names = [name for name, _ in named]
        if len(set(names)) < len(names):
            raise InputError(rejection("scenario", names, "names that differ"))
        for name in names:  # which files get
            if not re.fullmatch(r"\w[\w.-]*", name) or name.startswith(LAYOUT):
                accepted = f"letters, digits, . _ and -, and not {LAYOUT} at first"
                raise InputError(rejection("scenario name", name, accepted))

    @property
    def entries(self) -> tuple[str, ...]:
        """What is compared: the algorithms, and after each variant the same without a piece."""
        return tuple(
            entry
            for name in self.algorithm
            for entry in (name, *(f"{name}-{piece}" for piece in self.without))
            if entry == name or parameters_of(entry) != parameters_of(name)
        )

    @property
    def members(self) -> tuple[Learner, ...]:
        """The learners of each algorithm, scenario and horizon."""
        seeds = range(self.seed, self.seed + self.learners)
        return tuple(Learner(scheme, seed) for scheme in self.scheme for seed in seeds)

    def parts(self) -> list[range]:
        """Places in :attr:`members`, in near-equal parts of at most ``shard_learners``."""
        several = len(self.scheme) * self.learners
        bounds = range(math.ceil(several / self.shard_learners) + 1)
        ends = [place * several // bounds[-1] for place in bounds]
        return [range(start, stop) for start, stop in itertools.pairwise(ends)]

    def scenarios(self) -> dict[str, Scenario]:
        """By name, those that are named and then the random layouts."""
        seeds = range(self.layouts_seed, self.layouts_seed + self.layouts)
        drawn = {f"{LAYOUT}{seed}": Scenario(ue_positions=random_layout(seed)) for seed in seeds}
        return dict(named_scenario(entry) for entry in self.scenario) | drawn


def parameters_of(entry: str) -> AlgorithmParameters:
    """The hyperparameters with which an entry is compared.

    Args:
        entry: of :data:`ENTRIES`, or with a piece of :data:`PIECES` behind a hyphen, which is then
            as in the plain algorithm; one that the algorithm does not have changes nothing.
    """
    name, _, piece = entry.partition("-")
    if name in BESIDE:
        return DDPG()
    own, plain = ALGORITHMS[name](), ALGORITHMS[PLAIN.get(name, name)]()
    if isinstance(own, Robust) and own.guide is not None and piece in OFF:
        return dataclasses.replace(own, guide=own.guide.without(piece))
    if not hasattr(plain, piece):
        return own
    return dataclasses.replace(own, **{piece: getattr(plain, piece)})


def training_episodes(training: TrainingParameters) -> EvaluationParameters:
    """The episodes through which a training's evaluations fly.

    Raises:
        InputError: there is only one.
    """
    if training.evaluation_episodes < 2:
        accepted = "a whole number >= 2"
        raise InputError(rejection("evaluation_episodes", training.evaluation_episodes, accepted))
    return EvaluationParameters(
        episodes=training.evaluation_episodes, flights=1, seed=training.evaluation_seed
    )


def require_libraries(options: Compare) -> None:
    """Accept entries and an engine whose libraries can be imported.

    Raises:
        InputError: naming those that cannot, and how to get them.
    """
    require_installed([name for name in options.algorithm if name == PEER], "bench")
    require_installed([name for name in [options.engine] if name == "ray"], "cluster")
