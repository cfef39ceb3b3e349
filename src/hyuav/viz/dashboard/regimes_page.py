"""The page of the regimes: maps of which scheme is best, and by how much."""

import streamlit as st

from hyuav._support.errors import InputError, rejection
from hyuav._support.formatting import percent
from hyuav.experiments.regimes.work import REGIMES_FILE
from hyuav.viz.dashboard.plain import ensure_offered, plain, refusals
from hyuav.viz.data.index import RunIndex
from hyuav.viz.data.regimes import LABELS, SHADES, RegimeMap, read_regimes, shares_table, times
from hyuav.viz.html.regimes import BEST, VIEWS, regimes_map

KEPT = ("regimes_map", "regimes_view")

_LARGEST_FILE = 2**28
"""Bytes; a map of a million points takes less."""


def show(index: RunIndex) -> None:
    """The page."""
    st.header("Regimes", anchor=False)
    names = index.maps()
    if not names:
        st.info(f"No map in {plain(index.root)} yet: `hyuav regimes` makes one.")
        return
    ensure_offered("regimes_map", names)
    first, second = st.columns(2)
    name = first.selectbox("Map", names, key="regimes_map")
    view = second.radio(
        "Show", list(VIEWS), format_func=VIEWS.__getitem__, key="regimes_view", horizontal=True
    )
    with refusals():
        _draw(_read(index, name), view)


def _read(index: RunIndex, name: str) -> RegimeMap:
    file = index.file(name, REGIMES_FILE)
    index.file(name, "config.yaml")
    if file.stat().st_size > _LARGEST_FILE:
        raise InputError(rejection("map", str(file), f"at most {_LARGEST_FILE} bytes"))
    return read_regimes(file.parent)


def _draw(found: RegimeMap, view: str) -> None:
    st.plotly_chart(
        regimes_map(found, view), theme=None, key="regimes", config={"displaylogo": False}
    )
    if view == BEST:
        st.caption(SHADES)
    shares = shares_table(found)
    st.dataframe(
        {
            "Best at fixed power": [LABELS[name] for name in shares["best"]],
            "Share of the map": [percent(share) for share in shares["share"]],
            "Times the others, at most": [times(factor) for factor in shares["factor"]],
        },
        hide_index=True,
    )
    st.caption(f"Scenario {plain(found.name)}; the star marks {found.own_label}.")
