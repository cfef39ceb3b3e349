"""The page of the runs: what there is, what is in progress, and curves of any of them."""

import time
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import pandas as pd
import plotly.graph_objects as go
import streamlit as st

from hyuav._support.errors import InputError
from hyuav.viz.dashboard.curves import X_AXES, Choice, comparison
from hyuav.viz.dashboard.plain import plain, refusals
from hyuav.viz.data.configuration import differences
from hyuav.viz.data.curves import last_results, quantities
from hyuav.viz.data.index import MOST_DRAWN, STATES, RunEntry, RunIndex

KEPT = (
    *("search", "scenarios", "algorithms", "schemes", "states"),
    *("quantity", "against", "colors"),
)
"""Widgets that keep their values while another page is shown."""

SECONDS = 2.0
"""Between two looks at the files."""

_ROW, _TABLE = 35, 290
"""Heights in pixels."""

_LETTER = 6.5
"""Width in pixels of a table's letters."""

_BEST, _BEGUN = "Best return", "Begun (UTC)"
"""Columns of the list that are not shown as they are."""


def show(index: RunIndex) -> None:
    """The page; while it follows trainings, it is renewed every few seconds."""
    st.header("Runs", anchor=False)
    follow = st.toggle(
        "Follow trainings in progress", value=True, key="follow", persist_state="session"
    )
    st.fragment(_page, run_every=SECONDS if follow else None)(index)


def _page(index: RunIndex) -> None:
    entries = index.entries()
    if not entries:
        st.info(f"No runs in {plain(index.root)} yet: `hyuav train` begins one.")
        return
    now = time.time()
    found = _filtered(entries, now)
    running = sum(entry.state(now) == "running" for entry in entries)
    st.caption(f"{len(found)} of {len(entries)} runs, {running} in progress")
    height = min(_ROW * (len(found) + 1) + 3, _TABLE)
    columns = _columns([entry.name for entry in found])
    st.dataframe(_listing(found, now), hide_index=True, height=height, column_config=columns)
    chosen = _chosen(entries, found)
    metrics: dict[str, pd.DataFrame] = {}
    with st.container():  # what comes and goes in here moves no widget below, which would lose keys
        for entry in chosen:
            with refusals():
                metrics[entry.name] = index.metrics(entry.name)
        for entry in chosen:
            _progress(entry, now)
    if metrics:
        units = {entry.unit for entry in chosen}
        _drawn(index, metrics, units.pop() if len(units) == 1 else "")


def _filtered(entries: Sequence[RunEntry], now: float) -> list[RunEntry]:
    """The runs that the search and the filters leave."""
    search, filters = st.columns([4, 1], vertical_alignment="bottom")
    words = search.text_input(
        "Search", key="search", placeholder="words of a name, scenario, algorithm or scheme"
    )
    with filters.popover("Filter", width="stretch"):
        scenarios = _several("Scenario", "scenarios", {entry.scenario for entry in entries})
        algorithms = _several("Algorithm", "algorithms", {entry.algorithm for entry in entries})
        schemes = _several("Mode chosen by", "schemes", {s for e in entries for s in e.schemes})
        states = st.multiselect("State", STATES, key="states")
    return [
        entry
        for entry in entries
        if entry.matches(words.split())
        and (not scenarios or entry.scenario in scenarios)
        and (not algorithms or entry.algorithm in algorithms)
        and (not schemes or set(schemes) & set(entry.schemes))
        and (not states or entry.state(now) in states)
    ]


def _several(label: str, key: str, options: set[str]) -> list[str]:
    """Some of the options, of which those chosen earlier may be gone."""
    chosen = st.session_state.setdefault(key, [])
    kept = [value for value in chosen if value in options]
    if kept != chosen:  # set needlessly, a choice made during this renewal would be taken back
        st.session_state[key] = kept
    return st.multiselect(label, sorted(options), key=key)


def _listing(entries: Sequence[RunEntry], now: float) -> pd.DataFrame:
    return pd.DataFrame(
        {
            "Run": [entry.name for entry in entries],
            "State": [entry.state(now) for entry in entries],
            "Episode": [_episodes(entry) for entry in entries],
            _BEST: [entry.best for entry in entries],
            "Of": [entry.unit or "-" for entry in entries],
            "Scenario": [entry.scenario for entry in entries],
            "Algorithm": [entry.algorithm for entry in entries],
            "Mode chosen by": [", ".join(entry.schemes) for entry in entries],
            "Learners": [entry.learners for entry in entries],
            _BEGUN: pd.to_datetime([round(entry.begun) for entry in entries], unit="s", utc=True),
        }
    )


def _name_column(names: Iterable[str]) -> Any:
    """A column as wide as the longest name, since tables cut what is longer."""
    longest = max(map(len, names), default=0)
    return st.column_config.TextColumn(width=max(round(_LETTER * longest) + 18, 100))


def _columns(names: Iterable[str]) -> dict[str, Any]:
    column = st.column_config
    return {
        "Run": _name_column(names),
        _BEST: column.NumberColumn(format="%.2f", help="of a learner, noise-free"),
        _BEGUN: column.DatetimeColumn(format="YYYY-MM-DD HH:mm", timezone="UTC"),
    }


def _episodes(entry: RunEntry) -> str:
    planned = "" if entry.num_episodes is None else f" of {entry.num_episodes}"
    return f"{entry.episode}{planned}"


def _chosen(entries: Sequence[RunEntry], found: Sequence[RunEntry]) -> list[RunEntry]:
    """The runs to draw: the newest at first, and then what a person chooses."""
    by_name = {entry.name: entry for entry in entries}
    state = st.session_state
    if "drawn" not in state and found:
        state["drawn"] = [found[0].name]
    key = f"drawn-{state.get('drawings', 0)}"
    kept = [name for name in state.get(key, state.get("drawn", [])) if name in by_name]
    options = list(dict.fromkeys([*kept, *(entry.name for entry in found)]))
    choice, everything = st.columns([4, 1], vertical_alignment="bottom")
    everything.button(
        f"Draw all {len(found)}",
        on_click=_draw,
        args=([entry.name for entry in found],),
        disabled=not 0 < len(found) <= MOST_DRAWN,
        help=f"possible for up to {MOST_DRAWN} runs",
        width="stretch",
    )
    # A slow browser misses a value that is set once, when a renewal comes before it is shown;
    # the default comes with every renewal.
    names = choice.multiselect(
        "Runs to draw", options, default=kept, key=key, max_selections=MOST_DRAWN
    )
    state["drawn"] = names
    return [by_name[name] for name in names]


def _draw(names: list[str]) -> None:
    """Choose these in a new widget: of the former one, a browser may just be sending the value."""
    state = st.session_state
    state["drawn"], state["drawings"] = names, state.get("drawings", 0) + 1


def _progress(entry: RunEntry, now: float) -> None:
    if entry.state(now) == "running" and entry.num_episodes:
        share = min(entry.episode / entry.num_episodes, 1.0)
        st.progress(share, f"{plain(entry.name)}: episode {_episodes(entry)}")


def _drawn(index: RunIndex, metrics: Mapping[str, pd.DataFrame], unit: str) -> None:
    """The figure with its controls, and the tables below it."""
    choice = _choice(metrics, unit)
    references: dict[str, Mapping[str, float]] = {}
    with st.container():
        for name in metrics:
            with refusals():
                references[name] = index.references(name)
    figure = _figure(metrics, references, choice, unit)
    if not figure.data:
        st.info("No episode of this quantity is complete yet.")
        return
    st.plotly_chart(figure, key="curves", theme=None, config={"displaylogo": False})
    reached = last_results(metrics, choice.y, unit)
    st.dataframe(reached, hide_index=True, column_config={"Run": _name_column(metrics)})
    if len(metrics) > 1:
        st.subheader("What sets these runs apart", anchor=False)
        try:
            table = differences({name: index.configuration(name) for name in metrics})
        except InputError as error:
            st.error(plain(error))
            return
        if table.empty:
            st.caption("Nothing but their names.")
        else:
            st.dataframe(table)


class _Shown(NamedTuple):
    """The figure of the last renewal, and what it was made of."""

    figure: go.Figure
    metrics: Mapping[str, pd.DataFrame]
    made_of: tuple[Any, ...]


def _figure(
    metrics: Mapping[str, pd.DataFrame],
    references: Mapping[str, Mapping[str, float]],
    choice: Choice,
    unit: str,
) -> go.Figure:
    """The figure, made anew only where something has changed.

    Metrics without new rows are the same table as before.
    """
    shown: _Shown | None = st.session_state.get("shown")
    made_of = references, choice, unit, [(name, id(rows)) for name, rows in metrics.items()]
    if shown is None or shown.made_of != made_of:
        shown = _Shown(comparison(metrics, references, choice, unit), metrics, made_of)
        st.session_state["shown"] = shown
    return shown.figure


def _choice(metrics: Mapping[str, pd.DataFrame], unit: str) -> Choice:
    names = quantities(metrics, unit)
    what, against, smoothing, colors = st.columns([3, 3, 3, 2])
    if st.session_state.get("quantity") not in names:
        st.session_state["quantity"] = next(iter(names), None)
    return Choice(
        y=what.selectbox("Quantity", list(names), format_func=names.__getitem__, key="quantity"),
        x=against.selectbox("Against", list(X_AXES), format_func=X_AXES.__getitem__, key="against"),
        smoothing=smoothing.slider(
            "Smoothing (episodes)",
            *(1, 200, Choice.smoothing),
            key="smoothing",
            persist_state="session",
        ),
        color_by=colors.radio("Colour by", ("scheme", "run"), horizontal=True, key="colors"),
    )
