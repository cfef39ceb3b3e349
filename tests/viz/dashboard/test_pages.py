"""The pages as Streamlit runs them, without a browser."""

import dataclasses
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from streamlit.testing.v1 import AppTest

from dashboard_runs import SCENARIO, WriteRun, metrics_row
from hyuav.viz.dashboard.draft import load, save
from regime_maps import write_map


def _runs(root: str) -> None:
    from hyuav.viz.dashboard import runs_page
    from hyuav.viz.data.index import RunIndex

    runs_page.show(RunIndex(root))


def _flights(root: str) -> None:
    from hyuav.viz.dashboard import flights_page
    from hyuav.viz.data.index import RunIndex

    flights_page.show(RunIndex(root))


def _explorer(root: str) -> None:
    from hyuav.viz.dashboard import explorer_page
    from hyuav.viz.data.index import RunIndex

    explorer_page.show(RunIndex(root))


def _regimes(root: str) -> None:
    from hyuav.viz.dashboard import regimes_page
    from hyuav.viz.data.index import RunIndex

    regimes_page.show(RunIndex(root))


def _followed(root: str) -> None:
    import streamlit as st

    from hyuav.viz.dashboard import runs_page
    from hyuav.viz.data.index import RunIndex

    if "index" not in st.session_state:
        st.session_state["index"] = RunIndex(root)
    runs_page.show(st.session_state["index"])


PAGES = {"runs": _runs, "flights": _flights, "explorer": _explorer}


def opened(page: Callable[[str], None], root: Path) -> AppTest:
    return AppTest.from_function(page, kwargs={"root": str(root)}, default_timeout=60).run()


def errors(page: AppTest) -> list[str]:
    assert not page.exception
    return [error.value.replace("\\", "") for error in page.error]


def widget(page: AppTest, kind: str, label: str) -> Any:
    return next(own for own in page.get(kind) if getattr(own, "label", None) == label)


@pytest.mark.parametrize("page", PAGES.values(), ids=PAGES.keys())
@pytest.mark.parametrize("made", [False, True])
def test_every_page_opens_without_runs(
    tmp_path: Path, page: Callable[[str], None], made: bool
) -> None:
    if made:
        (tmp_path / "runs").mkdir()
    assert errors(opened(page, tmp_path / "runs")) == []


@pytest.mark.parametrize("page", PAGES.values(), ids=PAGES.keys())
def test_every_page_opens_with_a_trained_run(
    trained_runs: Path, page: Callable[[str], None]
) -> None:
    shown = opened(page, trained_runs)
    assert errors(shown) == []
    assert len(shown.get("plotly_chart")) >= 1


@pytest.mark.parametrize("page", PAGES.values(), ids=PAGES.keys())
def test_every_page_opens_with_runs_that_are_cut_off_or_damaged(
    write: WriteRun, tmp_path: Path, page: Callable[[str], None]
) -> None:
    with (write("cut", 5) / "metrics.csv").open("a") as file:
        file.write("6,60,0,hyb")
    (write("empty", 1) / "metrics.csv").write_bytes(b"")
    (write("foreign", 1) / "config.yaml").write_bytes(b"{]")
    assert errors(opened(page, tmp_path / "runs")) == []


def test_the_newest_run_is_drawn_and_any_can_be_compared(write: WriteRun, tmp_path: Path) -> None:
    for name in ("one", "two", "three"):
        write(name, 6)
    page = opened(_runs, tmp_path / "runs")
    assert len(widget(page, "multiselect", "Runs to draw").value) == 1
    widget(page, "multiselect", "Runs to draw").set_value(["one", "three"]).run()
    assert set(page.dataframe[1].value["Run"]) == {"one", "three"}
    next(button for button in page.button if button.label == "Draw all 3").click().run()
    assert set(page.dataframe[1].value["Run"]) == {"one", "two", "three"}
    widget(page, "multiselect", "Runs to draw").set_value(["two"]).run()
    assert set(page.dataframe[1].value["Run"]) == {"two"}
    assert errors(page) == []


def test_curves_are_computed_again_only_where_something_has_changed(
    write: WriteRun, tmp_path: Path
) -> None:
    path = write("one", 6) / "metrics.csv"
    page = opened(_followed, tmp_path / "runs")
    first = page.session_state["shown"]
    assert page.run().session_state["shown"] is first
    with path.open("a") as file:
        file.write(metrics_row(7) + "\n")
    second = page.run().session_state["shown"]
    assert [len(trace.x) for trace in second.figure.data] == [7]
    page.radio(key="colors").set_value("run").run()
    assert page.session_state["shown"].figure.data[0].line != second.figure.data[0].line
    assert errors(page) == []


def test_a_training_stays_drawn_when_its_comparison_renames_it(
    write: WriteRun, tmp_path: Path
) -> None:
    write("other", 3)
    unfinished = write("compared/shards/ddpg_T10.partial", 6)
    page = opened(_runs, tmp_path / "runs")
    widget(page, "multiselect", "Runs to draw").set_value(["compared/shards/ddpg_T10"]).run()
    unfinished.rename(unfinished.with_suffix(""))
    page.run()
    assert widget(page, "multiselect", "Runs to draw").value == ["compared/shards/ddpg_T10"]
    assert set(page.dataframe[1].value["Run"]) == {"compared/shards/ddpg_T10"}
    assert errors(page) == []


def test_the_search_and_the_filters_leave_what_was_asked_for(
    write: WriteRun, tmp_path: Path
) -> None:
    write("alpha", 6, num_episodes=6, scenario="campus")
    write("beta", 6, schemes=("relay",))
    page = opened(_runs, tmp_path / "runs")
    page.text_input(key="search").set_value("campus").run()
    assert page.dataframe[0].value["Run"].tolist() == ["alpha"]
    page.text_input(key="search").set_value("").run()
    page.multiselect(key="schemes").set_value(["relay"]).run()
    assert page.dataframe[0].value["Run"].tolist() == ["beta"]
    page.multiselect(key="states").set_value(["finished"]).run()
    assert page.dataframe[0].value.empty
    assert errors(page) == []


def test_what_sets_runs_apart_is_told(write: WriteRun, tmp_path: Path) -> None:
    write("one", 2, num_episodes=10)
    write("two", 2, num_episodes=20)
    page = opened(_runs, tmp_path / "runs")
    widget(page, "multiselect", "Runs to draw").set_value(["one", "two"]).run()
    table = page.dataframe[2].value
    assert list(table.loc["training.num_episodes"]) == ["10", "20"]
    assert len(table) == 1


def test_metrics_of_another_program_are_refused_in_a_line(write: WriteRun, tmp_path: Path) -> None:
    (write("foreign", 1) / "metrics.csv").write_text("a,b\n1,2\n")
    (line,) = errors(opened(_runs, tmp_path / "runs"))
    assert "metrics.csv header = b'a,b': expected columns" in line


HOSTILE = "![x](x.png)<img src=x onerror=alert(1)> :red[a] $x$"


@pytest.mark.parametrize("page", PAGES.values(), ids=PAGES.keys())
def test_no_name_becomes_markup(
    write: WriteRun, tmp_path: Path, page: Callable[[str], None]
) -> None:
    write(HOSTILE, 5, scenario=HOSTILE)
    (write("![y](y)", 1) / "metrics.csv").write_text("![z](z)\n1\n")
    shown = opened(page, tmp_path / "runs")
    assert not shown.exception
    for kind in ("markdown", "caption", "error", "info", "success", "progress"):
        for element in shown.get(kind):
            text = str(getattr(element, "value", None) or getattr(element.proto, "text", ""))
            assert "![" not in text
            assert "<img" not in text


def test_the_flights_of_an_evaluation_and_of_a_checkpoint_are_played(trained_runs: Path) -> None:
    page = opened(_flights, trained_runs)
    assert page.selectbox(key="flown_source").value == "kept by its evaluation"
    page.selectbox(key="flown_scheme").set_value("re_optimum").run()
    page.selectbox(key="flown_episode").set_value(1).run()
    page.selectbox(key="flown_source").set_value("of its best weights, flown now").run()
    page.selectbox(key="flown_learner").set_value(1).run()
    assert page.selectbox(key="flown_scheme").options == ["Re-OT"]
    assert errors(page) == []


def test_an_evaluation_that_is_kept_apart_is_played(runs: Path) -> None:
    apart = runs / "tiny" / "horizons" / "T10"
    apart.mkdir(parents=True)
    for name in ("evaluation.json", "flights.parquet"):
        shutil.copy(runs / "tiny" / name, apart)
    page = opened(_flights, runs)
    chosen = page.selectbox(key="flown_run")
    assert chosen.options == ["tiny", "tiny/horizons/T10 (evaluation)"]
    chosen.set_value("tiny/horizons/T10").run()
    assert page.selectbox(key="flown_source").options == ["kept by its evaluation"]
    assert "Optimum" in page.selectbox(key="flown_scheme").options
    assert errors(page) == []


@pytest.mark.parametrize("content", [b"", b"PAR1", b"not parquet at all"])
def test_damaged_flights_are_refused_in_a_line(runs: Path, content: bytes) -> None:
    (runs / "tiny" / "flights.parquet").write_bytes(content)
    (line,) = errors(opened(_flights, runs))
    assert "flights.parquet: expected the flights of an evaluation in Parquet (" in line


def test_a_changed_parameter_changes_the_optimum_at_once(tmp_path: Path) -> None:
    page = opened(_explorer, tmp_path)
    before = page.metric[0].value
    widget(page, "text_input", "Jamming power (W)").set_value("0.01").run()
    assert errors(page) == []
    assert page.metric[0].value != before
    assert "0.08 → 0.01" in "".join(caption.value for caption in page.caption).replace("\\", "")


def test_a_mistake_is_told_in_a_line_and_the_last_map_stays(tmp_path: Path) -> None:
    page = opened(_explorer, tmp_path)
    before = page.metric[0].value
    widget(page, "text_input", "Max speed (m/s)").set_value("fast").run()
    assert errors(page) == ["max_speed = 'fast': expected a number in [1e-09, 1e+09]"]
    assert page.metric[0].value == before
    widget(page, "text_input", "Max speed (m/s)").set_value("15").run()
    assert errors(page) == []


def test_a_node_is_moved_by_its_coordinates(tmp_path: Path) -> None:
    page = opened(_explorer, tmp_path)
    before = page.metric[0].value
    page.selectbox(key="node").set_value("eavesdropper (E)").run()
    widget(page, "number_input", "x (m)").set_value(-70.0).run()
    assert page.session_state["valid"].eavesdropper_positions == ((-70.0, 80.0),)
    assert page.metric[0].value != before
    widget(page, "number_input", "y (m)").set_value(700.0).run()
    (line,) = errors(page)
    assert line.startswith(
        "eavesdropper_positions[0] = (-70.0, 700.0): expected a position on the map"
    )


def test_helpers_and_eavesdroppers_are_added_and_one_of_them_is_moved(tmp_path: Path) -> None:
    short = dataclasses.replace(SCENARIO, num_slots=3, fading=False)
    save(short, tmp_path, "short")
    page = opened(_explorer, tmp_path)
    page.selectbox(key="begin").set_value("saved short").run()
    next(own for own in page.button if own.label == "Add an eavesdropper").click().run()
    assert page.selectbox(key="node").value == "eavesdropper (E) 2"
    widget(page, "number_input", "x (m)").set_value(-80.0).run()
    widget(page, "selectbox", "Eavesdroppers").set_value("colluding").run()
    next(own for own in page.button if own.label == "Add a helper").click().run()
    widget(page, "number_input", "x (m)").set_value(60.0).run()
    assert errors(page) == []
    assert page.session_state["valid"] == dataclasses.replace(
        short,
        eavesdropper_positions=((80.0, 80.0), (-80.0, 80.0)),
        eavesdroppers="colluding",
        helper_starts=((-60.0, -60.0), (60.0, -60.0)),
    )
    assert any("best flight that was found" in own.value for own in page.caption)
    next(own for own in page.button if own.label == "Remove this node").click().run()
    assert page.session_state["valid"].num_helpers == 1
    assert errors(page) == []


def test_a_checkpoint_flies_in_the_changed_scenario_until_it_does_not_fit(
    trained_runs: Path,
) -> None:
    page = opened(_explorer, trained_runs)
    page.selectbox(key="pilot").set_value("tiny").run()
    assert [own.label for own in page.metric] == ["Optimum", "Generalist", "Proposed", "No helper"]
    assert "of the optimum" in page.metric[1].delta
    next(button for button in page.button if button.label == "Remove this node").click().run()
    assert errors(page) == ["number of UEs = 9: expected 10, for which the checkpoint was trained"]
    assert [own.label for own in page.metric] == ["Optimum", "Generalist", "No helper"]


def test_the_optimum_is_refined_on_demand(tmp_path: Path) -> None:
    save(dataclasses.replace(SCENARIO, num_slots=3, fading=False), tmp_path, "short")
    page = opened(_explorer, tmp_path)
    page.selectbox(key="begin").set_value("saved short").run()
    assert any("a grid of 4 m" in caption.value for caption in page.caption)
    page.button(key="refine").click().run()
    assert any("a grid of 1 m" in caption.value for caption in page.caption)
    assert errors(page) == []


def test_a_scenario_is_saved_under_the_runs_and_taken_up_again(tmp_path: Path) -> None:
    page = opened(_explorer, tmp_path)
    widget(page, "text_input", "Jamming power (W)").set_value("0.3").run()
    page.text_input(key="save_name").set_value("louder").run()
    page.button(key="save").click().run()
    assert errors(page) == []
    assert load(tmp_path, "louder").jamming_power == 0.3
    assert f"--config-dir '{tmp_path}' scenario=louder" in page.code[0].value
    page.button(key="save").click().run()
    assert "name = 'louder': expected one that is not taken" in errors(page)[0]


def test_a_run_whose_scenario_is_damaged_is_no_beginning(write: WriteRun, tmp_path: Path) -> None:
    (write("damaged", 1) / "config.yaml").write_text("scenario: {ue_positions: 4}\n")
    page = opened(_explorer, tmp_path / "runs")
    page.selectbox(key="begin").set_value("run damaged").run()
    assert errors(page)[0].startswith("ue_positions = 4: expected")


def test_a_map_of_regimes_is_found_shown_and_its_damage_told(tmp_path: Path) -> None:
    assert errors(empty := opened(_regimes, tmp_path)) == []
    assert "hyuav regimes" in empty.info[0].value
    for name in ("one", "sweep/two"):
        write_map(tmp_path / name)
    page = opened(_regimes, tmp_path)
    assert page.selectbox(key="regimes_map").options == ["one", "sweep/two"]
    assert page.dataframe[0].value["Best at fixed power"].tolist()[:2] == ["No helper", "Relaying"]
    page.radio(key="regimes_view").set_value("gain").run()
    assert errors(page) == []
    assert len(page.get("plotly_chart")) == 1
    (tmp_path / "sweep" / "two" / "config.yaml").write_text("x: 3")
    (line,) = errors(page.selectbox(key="regimes_map").set_value("sweep/two").run())
    assert line.startswith("x = 3: expected names with values")
