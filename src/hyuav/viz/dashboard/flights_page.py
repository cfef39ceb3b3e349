"""The page of the flights: played slot by slot, from an evaluation or flown on the spot."""

import dataclasses
from functools import lru_cache
from pathlib import Path

import pandas as pd
import streamlit as st

from hyuav._support.errors import InputError, rejection
from hyuav.experiments.evaluation import FLIGHTS_FILE
from hyuav.physics.scenario import Scenario
from hyuav.viz.dashboard.plain import ensure_offered, plain, refusals
from hyuav.viz.data.flights import flying_schemes
from hyuav.viz.data.flying import checkpoint_of, flown_by, learner_label
from hyuav.viz.data.index import RunIndex, Stamp
from hyuav.viz.data.reading import read_flights
from hyuav.viz.data.schemes import scheme_label
from hyuav.viz.html.player import flight_player

KEPT = ("flown_run", "flown_source", "flown_learner", "flown_scheme", "flown_episode")

KEPT_FLIGHTS, FLOWN_NOW = "kept by its evaluation", "of its best weights, flown now"

WIDE, NARROW = "player-wide", "player-narrow"
"""Containers of the player, of which a page shows the one that suits its width."""

_BY_WIDTH = f"""<style>
@media (max-width: 900px) {{ .st-key-{WIDE} {{ display: none; }} }}
@media (min-width: 901px) {{ .st-key-{NARROW} {{ display: none; }} }}
</style>"""

_LARGEST_FILE = 2**28
"""Bytes; a few flights of each scheme take far less."""


def show(index: RunIndex) -> None:
    """The page."""
    st.header("Flights", anchor=False)
    evaluations = index.evaluations()
    listed = [*(entry.name for entry in index.entries()), *evaluations]
    sources = {name: _sources(index, name) for name in listed}
    names = [name for name, kinds in sources.items() if kinds]
    if not names:
        st.info(
            f"No run in {plain(index.root)} has flights or a checkpoint yet. "
            "`hyuav evaluate run=DIRECTORY` evaluates one."
        )
        return
    if st.session_state.get("flown_run") not in names:
        st.session_state["flown_run"] = next(
            (name for name in names if KEPT_FLIGHTS in sources[name]), names[0]
        )
    first, second = st.columns(2)
    run = first.selectbox(
        "Run",
        names,
        format_func=lambda name: f"{name} (evaluation)" if name in evaluations else name,
        key="flown_run",
    )
    ensure_offered("flown_source", sources[run])
    source = second.selectbox("Flights", sources[run], key="flown_source")
    with refusals():
        kept = source == KEPT_FLIGHTS
        scenario, flights = _evaluated(index, run) if kept else _flown_now(index, run)
        _play(scenario, flights)


def _sources(index: RunIndex, name: str) -> list[str]:
    kinds = {KEPT_FLIGHTS: (FLIGHTS_FILE,), FLOWN_NOW: ("checkpoints", "best.pt")}
    return [kind for kind, parts in kinds.items() if index.has(name, *parts)]


def _evaluated(index: RunIndex, name: str) -> tuple[Scenario, pd.DataFrame]:
    """The flights that a run's evaluation kept, and the scenario that was flown."""
    path = index.file(name, FLIGHTS_FILE)
    parameters = (index.evaluation(name) or {}).get("parameters")
    if not isinstance(parameters, dict):
        accepted = "a run whose evaluation.json names the scenario's parameters"
        raise InputError(rejection("run", name, accepted))
    state = path.stat()
    flights = kept_flights(path.parent, (state.st_mtime_ns, state.st_size))
    return Scenario.from_dict(parameters), flights


@lru_cache(maxsize=8)
def kept_flights(directory: Path, stamp: Stamp) -> pd.DataFrame:
    """The flights of an evaluation, which are read anew only where the file has changed.

    Args:
        directory: of ``flights.parquet``.
        stamp: the file's modification time and size.

    Raises:
        InputError: the file is damaged, another program's, or too large for a page.
    """
    if stamp[-1] > _LARGEST_FILE:
        accepted = f"at most {_LARGEST_FILE} bytes"
        raise InputError(rejection("flights", str(directory / FLIGHTS_FILE), accepted))
    return read_flights(directory)


def _flown_now(index: RunIndex, name: str) -> tuple[Scenario, pd.DataFrame]:
    """Flights of a learner of the run, through fading of its own scenario."""
    configuration = index.run(name).configuration()
    learners = configuration.learners
    labels = [learner_label(learner, configuration.scenario) for learner in learners]
    ensure_offered("flown_learner", range(len(labels)))
    number = st.selectbox(
        "Learner", range(len(labels)), format_func=labels.__getitem__, key="flown_learner"
    )
    learner = learners[number]
    scenario = dataclasses.replace(configuration.scenario, num_slots=configuration.horizons[number])
    checkpoint = checkpoint_of(index, name, number)
    return scenario, flown_by(scenario, learner.scheme, checkpoint).flights


def _play(scenario: Scenario, flights: pd.DataFrame) -> None:
    schemes = flying_schemes(flights)
    ensure_offered("flown_scheme", schemes)
    first, second = st.columns([2, 1])
    scheme = first.selectbox("Scheme", schemes, format_func=scheme_label, key="flown_scheme")
    own = flights[flights["scheme"] == scheme]
    episodes = sorted(int(episode) for episode in own["episode"].unique())
    ensure_offered("flown_episode", episodes)
    episode = second.selectbox("Episode", episodes, key="flown_episode")
    player(scenario, flights, scheme, episode)


def player(scenario: Scenario, flights: pd.DataFrame, scheme: str, episode: int) -> None:
    """Show a flight with its slider, with its panels beside the map or, on a phone, below it.

    Raises:
        InputError: the flights are not those of this scenario.
    """
    figures = {
        name: flight_player(scenario, flights, scheme, episode, narrow=name == NARROW)
        for name in (WIDE, NARROW)
    }
    st.html(_BY_WIDTH)  # a server does not know how wide a page is
    for name, figure in figures.items():
        with st.container(key=name):
            chart = f"{name}-chart"
            st.plotly_chart(figure, theme=None, key=chart, config={"displayModeBar": False})
