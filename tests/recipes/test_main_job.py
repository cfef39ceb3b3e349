"""The main job at its full length."""

import json
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest


@pytest.mark.slow
def test_the_main_job_finds_what_the_paper_reports(
    call: Callable[..., None], tmp_path: Path
) -> None:
    """The order of the schemes, the distance to the optimum, and relaying before jamming."""
    call("reproduce", "hydra.run.dir=job", "logger.mode=disabled")
    schemes = json.loads((tmp_path / "job" / "evaluation.json").read_text())["schemes"]
    rate = {name: result["secrecy_sum_rate"]["mean"] for name, result in schemes.items()}
    order = ["proposed", "ja_ot", "re_ot", "re_lt", "ja_lt"]
    assert sorted(order, key=lambda name: rate[name], reverse=True) == order
    assert schemes["proposed"]["fraction_of_optimum"] >= 0.97
    for name, result in schemes.items():
        half_width = result["secrecy_sum_rate"]["ci95"][1] - rate[name]
        assert rate[name] <= rate["optimum"] + half_width

    flights = pd.read_parquet(tmp_path / "job" / "flights.parquet")
    flown = flights[(flights["scheme"] == "proposed") & (flights["secrecy_sum_rate"] > 0)]
    for _, flight in flown.groupby("episode"):
        relays = flight["relay"].tolist()
        assert relays[0]
        assert relays == sorted(relays, reverse=True)
