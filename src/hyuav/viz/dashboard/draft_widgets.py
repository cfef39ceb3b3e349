"""The widgets of the scenario explorer, each of which writes into the draft."""

from typing import Any

import streamlit as st

from hyuav.physics.scenario import LARGEST_NUMBER_OF_HELPERS
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
    """A node's coordinates, and nodes to add and to take away."""
    options = list(drafts.nodes(_draft()))
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
    for field, name in drafts.SEVERAL.items():
        article = "an" if name[0] in "aeio" else "a"
        full = field == "helper_starts" and len(_draft()[field]) == LARGEST_NUMBER_OF_HELPERS
        buttons.button(
            f"Add {article} {name}", on_click=_add, args=(field,), disabled=full, width="stretch"
        )
    st.button(
        "Remove this node",
        on_click=_remove,
        args=(node,),
        disabled=not drafts.can_leave(_draft(), node),
        width="stretch",
    )
    if len(_draft()["eavesdropper_positions"]) > 1:
        _field(drafts.COLLUSION)


def _move(key: str, node: str, axis: int) -> None:
    to = list(drafts.position(_draft(), node))
    to[axis] = st.session_state[key]
    st.session_state["draft"] = drafts.moved(_draft(), node, (to[0], to[1]))


def place(x: float, y: float) -> None:
    """Move the chosen node to a position in m."""
    st.session_state["draft"] = drafts.moved(_draft(), st.session_state["node"], (x, y))
    _renew_coordinates()


def _add(field: str) -> None:
    """A node where the last one of its kind is, or a UE at the legitimate UAV, which covers it."""
    draft = _draft()
    last = draft[drafts.LEGITIMATE] if field == "ue_positions" else draft[field][-1]
    st.session_state["draft"], st.session_state["node"] = drafts.with_node(draft, field, last)
    _renew_coordinates()


def _remove(node: str) -> None:
    st.session_state["draft"] = drafts.without_node(_draft(), node)
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
