"""The report of a run: what it learned and how its schemes fly."""

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from hyuav._support.errors import InputError
from hyuav.experiments.evaluation import EvaluationParameters, evaluate
from hyuav.experiments.metrics import readable_metrics
from hyuav.experiments.policies import learned_policies, straight_policies
from hyuav.experiments.run_directory import RunDirectory, named_scenario
from hyuav.experiments.schemes import LABELS, LEARNED, LEARNED_AS_IN_PAPER, SCHEMES
from hyuav.physics.scenario import Scenario
from hyuav.viz.data.reading import readable_config, readable_evaluation, readable_flights
from hyuav.viz.html.curves import MAX_POINTS, QUANTITIES, learning_figure
from hyuav.viz.html.html import Page, Picture, Section
from hyuav.viz.html.maps import HEIGHT, TITLES, sum_rate_map
from hyuav.viz.html.player import flight_player
from hyuav.viz.html.tables import configuration_tables, scheme_table
from hyuav.viz.paper.curves import SMOOTHING
from hyuav.viz.paper.gallery import AS_IN_PAPER, HORIZONS

QUICK = EvaluationParameters(episodes=100, flights=1)
"""How runs are flown that nobody has evaluated."""

PLAYER_HEIGHT, CURVES_HEIGHT = 740, 460


@dataclasses.dataclass(frozen=True)
class _Flown:
    """What is known of flights, from an evaluation or flown for the report."""

    scenario: Scenario
    summary: dict[str, Any]
    flights: pd.DataFrame
    note: str


def run_page(directory: Path) -> Page:
    """What a run directory tells, however much of it is there yet."""
    config = readable_config(directory)
    name, scenario = _scenario(config)
    metrics, evaluations = _metrics(directory), _evaluations(directory, scenario)
    if scenario is None and evaluations:  # kept apart from its runs
        name, scenario = _scenario({"scenario": _named(evaluations[0].summary)})
    flown, failure = _flown(directory, name, scenario, evaluations)
    known = [own.summary for own in evaluations] or [own.summary for own in flown]
    sections = [
        _flights(flown, failure),
        _curves(metrics, known, scenario),
        _schemes(known, [own.note for own in flown if not evaluations]),
        map_section({name: scenario} if scenario else {}),
        config_section(config),
    ]
    return Page("Run", directory.resolve().name, _facts(config, name, scenario, metrics), sections)


@dataclasses.dataclass(frozen=True)
class _Evaluated:
    """An evaluation of the run over one horizon."""

    directory: Path
    summary: dict[str, Any]


def _evaluations(directory: Path, scenario: Scenario | None) -> list[_Evaluated]:
    """Those that can be read, one for each horizon: the scenario's own, then the shortest first."""
    found: dict[int, _Evaluated] = {}
    for place in (directory, *directory.glob(f"{HORIZONS}/T*")):
        summary = readable_evaluation(place)
        if summary is not None:
            found.setdefault(summary["num_slots"], _Evaluated(place, summary))
    return [found[horizon] for horizon in _own_first(found, scenario)]


def _own_first(horizons: Iterable[int], scenario: Scenario | None) -> list[int]:
    own = None if scenario is None else scenario.num_slots
    return sorted(horizons, key=lambda horizon: (horizon != own, horizon))


def _named(evaluation: Mapping[str, Any]) -> dict[str, Any]:
    parameters = evaluation.get("parameters")
    fields = parameters if isinstance(parameters, dict) else {}
    return {"name": evaluation.get("scenario", "unknown"), **fields}


def _scenario(config: Mapping[str, Any]) -> tuple[str, Scenario | None]:
    try:
        return named_scenario(config.get("scenario"))
    except InputError:
        return "unknown", None


def _metrics(directory: Path) -> pd.DataFrame:
    """Of the run, and of the paper's own algorithm where it was trained beside it."""
    own = RunDirectory(directory)
    paper = RunDirectory(directory / AS_IN_PAPER)
    rows = [
        readable_metrics(run.metrics_file).replace({"scheme": names})
        for run, names in ((own, LEARNED), (paper, LEARNED_AS_IN_PAPER))
    ]
    return pd.concat([table for table in rows if len(table)] or rows[:1], ignore_index=True)


def _facts(
    config: Mapping[str, Any], name: str, scenario: Scenario | None, metrics: pd.DataFrame
) -> dict[str, str]:
    facts = {"Scenario": name}
    if scenario is not None:
        facts["UEs"] = str(scenario.num_ues)
    for title, section, entry in (
        ("Algorithm", "algorithm", "name"),
        ("Episodes asked for", "training", "num_episodes"),
    ):
        values = config.get(section)
        if isinstance(values, Mapping) and entry in values:
            facts[title] = str(values[entry])
    if len(metrics):
        facts["Episodes done"] = f"{metrics['episode'].max():.0f}"
        facts["Learners"] = str(len(metrics[["learner", "scheme"]].drop_duplicates()))
        facts["Slots per episode"] = ", ".join(
            f"{slots:.0f}" for slots in sorted(metrics["num_slots"].dropna().unique())
        )
    return facts


def _flown(
    directory: Path,
    name: str,
    scenario: Scenario | None,
    evaluations: Sequence[_Evaluated],
) -> tuple[list[_Flown], str]:
    """The flights of the evaluations, or else some flown now; and why there are none."""
    kept = [(own.summary, readable_flights(own.directory)) for own in evaluations]
    if any(flights is not None for _, flights in kept):
        note = "Flights of the evaluation, each scheme's first."
        flown = [
            _Flown(of, summary, flights, note)
            for summary, flights in kept
            for _, of in [_scenario({"scenario": _named(summary)})]
            if flights is not None and of is not None
        ]
        return flown, "" if flown else "The evaluation's scenario cannot be read."
    if scenario is None:
        return [], "There is no configuration to fly by."
    run = RunDirectory(directory)
    if not run.best_checkpoint.is_file():
        return [], "There are no weights to fly by yet."
    try:
        return [_fly(run, name)], ""
    except InputError as error:
        return [], f"The weights cannot be flown: {error}"


def _fly(run: RunDirectory, name: str) -> _Flown:
    """Fly the best weights and the straight flights through a few episodes."""
    configuration = run.configuration()
    scenario = configuration.scenario
    horizons = [learner.num_slots or scenario.num_slots for learner in configuration.learners]
    if scenario.num_slots not in horizons:
        scenario = dataclasses.replace(scenario, num_slots=max(horizons))
    policies = learned_policies([run], scenario)
    policies |= straight_policies(scenario)[0]
    evaluation = evaluate(scenario, name, policies, QUICK)
    note = (
        f"Nothing was evaluated yet: for this report, the best weights so far and the straight "
        f"references were flown through {QUICK.episodes} episodes."
    )
    return _Flown(scenario, evaluation.summary, evaluation.flights, note)


def _flights(several: Sequence[_Flown], failure: str) -> Section:
    if not several:
        return Section("Flights", [failure])
    figures, notes = {}, list(dict.fromkeys(flown.note for flown in several))
    for flown in several:
        horizon = f"T = {flown.scenario.num_slots}: " if len(several) > 1 else ""
        for scheme in sorted(dict.fromkeys(flown.flights["scheme"]), key=_place):
            label = f"{horizon}{LABELS.get(scheme, scheme)}"
            try:
                figures[label] = flight_player(flown.scenario, flown.flights, scheme)
            except InputError as error:
                notes.append(f"{label} is left out: {error}")
    notes.append(
        "Move the slider, or play. Filled UEs offload; lines show the links that are alive in the "
        "slot. The thin lines over the sum-rates are what relaying (solid) and jamming (dashed) "
        "would have brought."
    )
    pictures = [Picture("Flight", figures, PLAYER_HEIGHT)] if figures else []
    return Section("Flights", notes, pictures)


def _place(scheme: object) -> int:
    """In the order of the table; what is unknown comes last."""
    return list(LABELS).index(str(scheme)) if scheme in LABELS else len(LABELS)


def _curves(
    metrics: pd.DataFrame, summaries: Sequence[Mapping[str, Any]], scenario: Scenario | None
) -> Section:
    optima = {summary["num_slots"]: _optima(summary["schemes"]) for summary in summaries}
    horizons = _own_first(metrics["num_slots"].dropna().unique(), scenario)
    figures = {
        title + (f", T = {horizon:.0f}" if len(horizons) > 1 else ""): learning_figure(
            own, optima.get(int(horizon)), quantity
        )
        for horizon in horizons
        for own in [metrics[metrics["num_slots"] == horizon]]
        for quantity, title in QUANTITIES.items()
        if own[quantity].notna().any()
    }
    if not figures:
        return Section("Learning curves", ["No episode was logged yet."])
    notes = [
        "A line is the interquartile mean over the learners of a scheme, and the band its 95 % "
        "bootstrap interval; behind a single learner's line stands each episode's reward. The "
        f"accumulated rewards are means of {SMOOTHING} episodes, and more than {MAX_POINTS} points "
        "are averaged in groups. Dashed is what only jams, and dotted an optimum."
    ]
    if metrics["scheme"].isin(LEARNED_AS_IN_PAPER.values()).any():
        notes.append("The thinner, paler lines are learned by the paper's own algorithm.")
    return Section("Learning curves", notes, [Picture("Quantity", figures, CURVES_HEIGHT)])


def _optima(schemes: Mapping[str, Any]) -> dict[str, float]:
    """What the best flight of each scheme earns in bps/Hz, where it was evaluated."""
    return {
        name: schemes[scheme.optimum]["secrecy_sum_rate"]["mean"]
        for name, scheme in SCHEMES.items()
        if scheme.optimum in schemes
    }


def _schemes(summaries: Sequence[Mapping[str, Any]], notes: Sequence[str]) -> Section:
    if not summaries:
        return Section("Schemes", ["There is no evaluation yet."])
    return Section("Schemes", notes, tables=[scheme_table(summary) for summary in summaries])


def map_section(scenarios: Mapping[str, Scenario]) -> Section:
    """Maps of the secrecy sum-rate in each mode."""
    if not scenarios:
        return Section("Maps", ["There is no scenario that can be read."])
    pictures = [
        Picture(
            f"{title}, {name}",
            {"": sum_rate_map(scenario, mode, scenario.map_side / 100).update_layout(title=None)},
            HEIGHT,
            small=True,
        )
        for name, scenario in scenarios.items()
        for mode, title in TITLES.items()
    ]
    notes = [
        "The secrecy sum-rate of one slot at every position of the helper, without fading. On the "
        "map of the better mode, the solid white line goes around where relaying is better, the "
        "dashed one around where jamming is; elsewhere neither brings anything. The dotted circle "
        "is the coverage of the legitimate UAV."
    ]
    return Section("Maps", notes, pictures)


def config_section(config: Mapping[str, Any]) -> Section:
    """All that was asked for."""
    if not config:
        return Section("Configuration", ["There is no config.yaml that can be read."])
    return Section("Configuration", tables=[configuration_tables(config)])
