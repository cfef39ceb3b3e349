"""The widgets of the scenario explorer, each of which writes into the draft."""

from typing import Any

import streamlit as st

from hyuav.viz.dashboard import draft as drafts
from hyuav.viz.dashboard.draft import CHOICES, FIELDS, GROUPS, KINDS, Draft
from hyuav.viz.dashboard.plain import ensure_offered

_STEP = 1.0
"""Metres by which the buttons beside a coordinate move a node."""

_AS_ENTERED = (bool, int, str)
"""Kinds whose widgets give the values themselves; the others give text."""


def editor() -> None:
    """The nodes and the parameters of the draft, in tabs."""
    nodes, *groups = st.tabs(["Nodes", *GROUPS])
    with nodes:
        _nodes()
    for tab, names in zip(groups, GROUPS.values(), strict=True):
        with tab:
            columns = st.columns(2)
            for place, name in enumerate(names):
                with columns[place % 2]:
                    _field(name)


def _draft() -> Draft:
    draft: Draft = st.session_state["draft"]
    return draft


def _nodes() -> None:
    """A node's coordinates, and UEs to add and to take away."""
    options = drafts.nodes(_draft())
    ensure_offered("node", options)
    node = st.selectbox("Node to move", options, key="node")
    coordinates = st.container(horizontal=True)
    for axis in (0, 1):
        key = f"at-{st.session_state['edition']}-{st.session_state.get('placed', 0)}-{node}-{axis}"
        st.session_state.setdefault(key, drafts.position(_draft(), node)[axis])
        coordinates.number_input(
            f"{'xy'[axis]} (m)",
            step=_STEP,
            format="%g",
            key=key,
            on_change=_move,
            args=(key, node, axis),
        )
    st.caption("Or click on the map: the node moves there.")
    buttons = st.container(horizontal=True)
    buttons.button("Add a UE", on_click=_add, width="stretch")
    buttons.button(
        "Remove this UE",
        on_click=_remove,
        args=(node,),
        disabled=not node.startswith("UE ") or len(_draft()["ue_positions"]) == 1,
        width="stretch",
    )


def _move(key: str, node: str, axis: int) -> None:
    to = list(drafts.position(_draft(), node))
    to[axis] = st.session_state[key]
    st.session_state["draft"] = drafts.moved(_draft(), node, (to[0], to[1]))


def place(x: float, y: float) -> None:
    """Move the chosen node to a position in m."""
    st.session_state["draft"] = drafts.moved(_draft(), st.session_state["node"], (x, y))
    _renew_coordinates()


def _add() -> None:
    """A UE at the legitimate UAV, where it is seen and covered."""
    at = drafts.position(_draft(), drafts.NODES["legitimate_position"])
    st.session_state["draft"] = drafts.with_ue(_draft(), at)
    st.session_state["node"] = f"UE {len(_draft()['ue_positions'])}"
    _renew_coordinates()


def _remove(node: str) -> None:
    st.session_state["draft"] = drafts.without_ue(_draft(), node)
    _renew_coordinates()


def _renew_coordinates() -> None:
    """Have the coordinates shown anew that were not typed in."""
    st.session_state["placed"] = st.session_state.get("placed", 0) + 1


def _field(name: str) -> None:
    """The widget that suits a parameter; what it is given goes into the draft as it is."""
    key, label = f"field-{st.session_state['edition']}-{name}", drafts.label(name)
    value, kind = _draft()[name], KINDS[name]
    st.session_state.setdefault(key, value if kind in _AS_ENTERED else drafts.shown(value))
    own: Any = {"key": key, "on_change": _store, "args": (key, name)}
    own["help"] = FIELDS[name].metadata["symbol"] or None
    if kind is bool:
        st.toggle(label, **own)
    elif kind is str:
        st.selectbox(label, CHOICES[name], **own)
    elif kind is int:
        st.number_input(label, step=1, **own)
    else:
        st.text_input(label, **own)


def _store(key: str, name: str) -> None:
    entered = st.session_state[key]
    value = entered if KINDS[name] in _AS_ENTERED else drafts.read(name, entered)
    st.session_state["draft"] = {**_draft(), name: value}
