import itertools
from pathlib import Path

import numpy as np
from PIL import Image, ImageSequence

from hyuav import Scenario
from hyuav.experiments.evaluation import Evaluation
from hyuav.viz.data.flights import read_flight
from hyuav.viz.paper.animation import MIXED, animate_flight


def test_a_flight_in_motion_has_a_frame_for_the_start_and_each_slot(
    scenario: Scenario, evaluation: Evaluation, tmp_path: Path
) -> None:
    file = tmp_path / "new" / "flight.gif"
    animate_flight(scenario, read_flight(scenario, evaluation.flights, "proposed"), file)
    with Image.open(file) as gif:
        frames = [
            (np.asarray(frame.convert("RGB")), frame.info["duration"])
            for frame in ImageSequence.Iterator(gif)
        ]
    assert len(frames) == scenario.num_slots + 1
    assert all((one != other).any() for (one, _), (other, _) in itertools.pairwise(frames))
    assert frames[-1][1] > frames[0][1]
    assert file.stat().st_size < 500_000


def test_several_helpers_move_in_one_picture(
    relaying_and_jamming: tuple[Scenario, Evaluation], tmp_path: Path
) -> None:
    scenario, evaluation = relaying_and_jamming
    flight = read_flight(scenario, evaluation.flights, "proposed")
    animate_flight(scenario, flight, tmp_path / "flight.gif")
    with Image.open(tmp_path / "flight.gif") as gif:
        last = np.asarray(list(ImageSequence.Iterator(gif))[-1].convert("RGB"))
    grey = round(255 * float(MIXED))
    assert (last == grey).all(axis=-1).sum() > 200  # the bars of slots with both modes
