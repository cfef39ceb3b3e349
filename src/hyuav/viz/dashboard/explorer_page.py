"""The scenario explorer: change anything, and see at once what it does to the best flight."""

from functools import lru_cache
from pathlib import Path

import plotly.graph_objects as go
import streamlit as st

from hyuav._support.errors import InputError
from hyuav._support.formatting import percent
from hyuav.experiments.evaluation import Evaluation
from hyuav.experiments.scenarios import named_scenario
from hyuav.experiments.schemes import GENERALISTS, LEARNED, NO_HELPER, OPTIMA
from hyuav.physics.modes import MODE_RULES
from hyuav.physics.scenario import PRESETS, Scenario
from hyuav.viz.dashboard import draft as drafts
from hyuav.viz.dashboard.draft_widgets import editor, place
from hyuav.viz.dashboard.flights_page import player
from hyuav.viz.dashboard.overlay import QUANTITIES, add_flights, explorer_map
from hyuav.viz.dashboard.plain import ensure_offered, plain, refusals
from hyuav.viz.data.flights import flying_schemes
from hyuav.viz.data.flying import (
    COARSE_DRAWS,
    EPISODES,
    FINE_DRAWS,
    Checkpoint,
    checkpoint_of,
    flown,
    learner_label,
    resolution,
)
from hyuav.viz.data.index import RunIndex
from hyuav.viz.data.schemes import scheme_label

KEPT = (
    *("draft", "original", "valid", "node", "begin", "rule", "mapped", "pilot", "pilot_learner"),
    *("play", "played"),
)

PRESET, SAVED, RUN = "preset ", "saved ", "run "
"""What the names of scenarios to begin with start with."""

NOBODY = "none"

MAP = "explorer-map"
"""Container of the map."""

_TALLEST, _ABOVE = 740, 140
"""Pixels of the map's figure, and how much higher it is than a narrow page is wide."""

_MAP_HEIGHT = f"""<style>
:has(> .st-key-{MAP}) {{ flex-basis: min({_TALLEST}px, 100vw + {_ABOVE}px) !important; }}
</style>"""

_OUTLINES = (
    " White lines go around where relaying brings more (solid) and where jamming does (dashed)."
)

BEST = ("checkpoints", "best.pt")
"""Where a run keeps its best weights."""


_map = lru_cache(maxsize=32)(explorer_map)


def show(index: RunIndex) -> None:
    """The page."""
    st.header("Scenario explorer", anchor=False)
    if "draft" not in st.session_state:
        _begin(Scenario.preset("two_clusters"))
    left, right = st.columns([2, 3], gap="medium")
    with left:
        _choose_beginning(index)
        editor()
        scenario = _checked()
        _tell_changes(scenario)
        _save(index.root, scenario)
    with right:
        evaluation = _explore(index, scenario)
    if evaluation is not None:
        _play(scenario, evaluation)


def _begin(scenario: Scenario) -> None:
    """Forget what was entered, and go on from here."""
    state = st.session_state
    state["draft"], state["original"], state["valid"] = scenario.to_dict(), scenario, scenario
    state["edition"] = state.get("edition", 0) + 1


def _choose_beginning(index: RunIndex) -> None:
    options = [
        *(PRESET + name for name in sorted(PRESETS, reverse=True)),
        *(SAVED + name for name in drafts.saved(index.root)),
        *(RUN + entry.name for entry in index.entries()),
    ]
    ensure_offered("begin", options)
    st.selectbox("Begin with", options, key="begin", on_change=_load, args=(index,))
    if problem := st.session_state.pop("begin_problem", None):
        st.error(plain(problem))


def _load(index: RunIndex) -> None:
    chosen = st.session_state["begin"]
    try:
        if chosen.startswith(PRESET):
            _begin(Scenario.preset(chosen.removeprefix(PRESET)))
        elif chosen.startswith(SAVED):
            _begin(drafts.load(index.root, chosen.removeprefix(SAVED)))
        else:
            values = index.configuration(chosen.removeprefix(RUN)).get("scenario", {})
            _begin(named_scenario(values)[1])
    except InputError as error:
        st.session_state["begin_problem"] = error


def _checked() -> Scenario:
    """What was entered, or the last that was acceptable."""
    try:
        st.session_state["valid"] = Scenario.from_dict(st.session_state["draft"])
    except InputError as error:
        st.error(plain(error))
        st.caption("The map shows the last scenario without this value.")
    valid: Scenario = st.session_state["valid"]
    return valid


def _tell_changes(scenario: Scenario) -> None:
    changes = drafts.changes(scenario, st.session_state["original"])
    if not changes:
        return
    told = [
        f"{drafts.label(name)}: {f'{old} → {new}' if old else 'other positions'}"
        for name, (old, new) in changes.items()
    ]
    st.caption(f"Changed: {plain('; '.join(told))}")


def _save(root: Path, scenario: Scenario) -> None:
    with st.expander("Save the scenario"):
        name = st.text_input("Name", key="save_name", placeholder="my_scenario")
        replace = st.checkbox("Replace one of this name", key="save_replace")
        if not st.button("Save", key="save", disabled=not name):
            return
        with refusals():
            path = drafts.save(scenario, root, name, replace=replace)
            st.success(f"Saved as {plain(path)}. To train on it:")
            command = f"hyuav train --config-dir '{root}' scenario={name}"
            st.code(command, language="sh", wrap_lines=True)


def _explore(index: RunIndex, scenario: Scenario) -> Evaluation | None:
    """The map of the scenario with the flights, and what they bring."""
    first, second = st.columns(2)
    rule = first.radio("Mode chosen by", MODE_RULES, key="rule", horizontal=True)
    mapped = second.radio(
        "Map", list(QUANTITIES), format_func=QUANTITIES.__getitem__, key="mapped", horizontal=True
    )
    checkpoint = _pilot(index, rule)
    evaluation = _flown(scenario, rule, checkpoint)
    figure = go.Figure(_map(scenario, rule, mapped))
    if evaluation is not None:
        _tell(evaluation, rule)
        add_flights(figure, scenario, evaluation.flights)
    key = f"map-{st.session_state['edition']}-{st.session_state.get('placed', 0)}"
    st.html(_MAP_HEIGHT)
    with st.container(key=MAP, height=_TALLEST, border=False):
        st.plotly_chart(
            figure,
            theme=None,
            key=key,
            height="stretch",
            on_select=lambda: _place(key),
            selection_mode="points",
            config={"displayModeBar": False},
        )
    if evaluation is not None:
        _tell_accuracy(scenario, rule, evaluation)
    return evaluation


def _pilot(index: RunIndex, rule: str) -> Checkpoint | None:
    """The checkpoint that is to fly, if any."""
    names = [entry.name for entry in index.entries() if index.has(entry.name, *BEST)]
    options = [NOBODY, *names]
    ensure_offered("pilot", options)
    first, second = st.columns(2)
    name = first.selectbox("Fly the checkpoint of", options, key="pilot")
    if name == NOBODY:
        second.selectbox("Learner", [], placeholder="of a checkpoint", disabled=True)
        return None
    with refusals():
        configuration = index.run(name).configuration()
        labels = {
            number: learner_label(learner, configuration.scenario)
            for number, learner in enumerate(configuration.learners)
            if learner.scheme == rule
        }
        if not labels:
            second.selectbox("Learner", [], placeholder=f"none for {rule}", disabled=True)
            return None
        ensure_offered("pilot_learner", list(labels))
        number = second.selectbox(
            "Learner", list(labels), format_func=labels.__getitem__, key="pilot_learner"
        )
        return checkpoint_of(index, name, number)
    return None


def _flown(scenario: Scenario, rule: str, checkpoint: Checkpoint | None) -> Evaluation | None:
    """The flights, without the checkpoint where it does not fit; None where none can be shown."""
    fine = _is_refined(scenario, rule)
    with refusals():
        try:
            return flown(scenario, rule, checkpoint, fine=fine)
        except InputError as error:
            if checkpoint is None:
                raise
            st.error(plain(error))
            return flown(scenario, rule, fine=fine)
    return None


def _is_refined(scenario: Scenario, rule: str) -> bool:
    return bool(st.session_state.get("refined") == (scenario, rule))


def _tell(evaluation: Evaluation, rule: str) -> None:
    """What the flights bring on average, the optimum first."""
    schemes = evaluation.summary["schemes"]
    wanted = OPTIMA[rule], GENERALISTS[rule], LEARNED[rule], NO_HELPER
    shown = [name for name in wanted if name in schemes]
    best = schemes[OPTIMA[rule]]["secrecy_sum_rate"]["mean"]
    for column, name in zip(st.columns(len(shown)), shown, strict=True):
        result = schemes[name]
        mean = result["secrecy_sum_rate"]["mean"]
        beside = name != OPTIMA[rule] and best > 0.0
        column.metric(
            scheme_label(name),
            f"{mean:.2f} bps/Hz",
            f"{percent(mean / best)} of the optimum" if beside else None,
            delta_color="off",
            border=True,
        )
        relaying = f"{percent(result['relay_share'], 0)} of the slots relay, "
        column.caption(
            f"{'' if name == NO_HELPER else relaying}"
            f"{percent(result['offloading_share'], 0)} of the UEs offload"
        )


def _place(key: str) -> None:
    """Move the chosen node to where the map was clicked."""
    points = st.session_state[key]["selection"]["points"]
    if points:
        place(float(points[0]["x"]), float(points[0]["y"]))


def _tell_accuracy(scenario: Scenario, rule: str, evaluation: Evaluation) -> None:
    """How exactly the optimum is known, and a button to know it better."""
    fine = _is_refined(scenario, rule)
    spacing, draws = resolution(scenario, fine=fine), FINE_DRAWS if fine else COARSE_DRAWS
    told, mapped = "The optimum is exact", "The map is"
    if scenario.num_helpers > 1:
        told = "The optimum is the best flight that was found"
        mapped = "The map is of one helper alone and"
    bound = evaluation.summary["schemes"][OPTIMA[rule]].get("upper_bound")
    st.caption(
        f"{told} on a grid of {spacing:g} m with {draws} draws of the fading; "
        f"{'' if bound is None else f'no flight earns more than {bound:.2f} bps/Hz; '}"
        f"means are of the same {EPISODES.episodes} episodes. {mapped} without fading."
        f"{_OUTLINES if rule == 'hybrid' else ''}"
    )
    if not fine:
        finer = f"Refine the optimum to {resolution(scenario, fine=True):g} m"
        if st.button(finer, help="takes some seconds", key="refine"):
            with st.spinner("Solving"), refusals():
                flown(scenario, rule, fine=True)
                st.session_state["refined"] = scenario, rule
                st.rerun()


def _play(scenario: Scenario, evaluation: Evaluation) -> None:
    """A flight slot by slot, where it is wanted."""
    if not st.toggle("Play a flight slot by slot", key="play"):
        return
    schemes = flying_schemes(evaluation.flights)
    ensure_offered("played", schemes)
    scheme = st.selectbox("Flight of", schemes, format_func=scheme_label, key="played")
    with refusals():
        player(scenario, evaluation.flights, scheme, 0)
