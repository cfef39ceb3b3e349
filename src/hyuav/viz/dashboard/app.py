"""The page that Streamlit runs: ``streamlit run app.py -- RUNS``."""

import sys
from pathlib import Path

import streamlit as st
import torch

from hyuav.viz.dashboard import explorer_page, flights_page, regimes_page, runs_page
from hyuav.viz.data.index import RunIndex

PAGES = {
    "Runs": runs_page,
    "Flights": flights_page,
    "Scenario explorer": explorer_page,
    "Regimes": regimes_page,
}


@st.cache_resource(show_spinner=False)
def open_index(root: str) -> RunIndex:
    """One index for all who look."""
    torch.set_num_threads(1)  # the trainings that are followed need the other cores
    return RunIndex(root)


def main(root: Path) -> None:
    """Show the page that was chosen."""
    st.set_page_config(page_title="HyUAV", layout="wide")
    for module in PAGES.values():
        for key in module.KEPT:  # or what was entered would be lost with the page
            if key in st.session_state:
                st.session_state[key] = st.session_state[key]
    # Streamlit's own navigation asks for addresses that do not exist when a page is reloaded.
    page = st.segmented_control(
        "Page",
        list(PAGES),
        default=next(iter(PAGES)),
        required=True,
        key="page",
        bind="query-params",
        label_visibility="collapsed",
    )
    PAGES[page].show(open_index(str(root)))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
