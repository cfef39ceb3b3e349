"""The dashboard in a real browser over HTTP, and while a training runs."""

import re
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import BrowserContext, Page, expect

from browser import DESKTOP, PATIENCE, PHONE, BrowserPage, browser, needs_chromium, window
from dashboard_runs import write_run
from dashboard_server import dashboard, recipe
from hyuav.viz.dashboard.draft import load
from regime_maps import write_map

pytestmark = [needs_chromium, pytest.mark.slow]

LONG = 100_000
"""Logged points of the longest run."""

WIDTHS = pytest.mark.parametrize("size", [DESKTOP, PHONE], ids=["desktop", "phone"])


@pytest.fixture(scope="module")
def runs(trained_runs: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Runs of all kinds, the trained one as the newest."""
    root = tmp_path_factory.mktemp("served") / "runs"
    write_run(root, "long", LONG, num_episodes=LONG)
    with (write_run(root, "cut", 40) / "metrics.csv").open("a") as file:
        file.write("41,410,0,hyb")
    (write_run(root, "empty", 1) / "metrics.csv").write_bytes(b"")
    write_run(root, "<img src=x onerror=alert(1)>", 30, scenario="![x](http://example.org/x)")
    write_map(root / "regimes")
    shutil.copytree(trained_runs / "tiny", root / "tiny", copy_function=shutil.copy)
    return root


@pytest.fixture(scope="module")
def address(runs: Path) -> Iterator[str]:
    with dashboard(runs) as (address, _):
        yield address


@pytest.fixture(scope="module")
def context() -> Iterator[BrowserContext]:
    with browser() as context:
        yield context


@pytest.fixture
def opened(context: BrowserContext, address: str, size: tuple[int, int]) -> Iterator[BrowserPage]:
    """The dashboard in a window, of which nothing may go wrong."""
    with window(context, *size) as opened:
        opened.page.goto(address)
        yield opened
        assert opened.page.evaluate("document.documentElement.scrollWidth") <= size[0]
        assert opened.errors == []
        assert opened.refused == []


def rest(page: Page) -> None:
    """Wait until all is drawn that was asked for; trainings that are followed leave a moment."""
    page.locator("[data-test-script-state=notRunning]").wait_for()


def go_to(page: Page, title: str) -> None:
    page.get_by_role("radio", name=title).or_(page.get_by_role("button", name=title)).first.click()
    expect(page.get_by_role("heading", name=title)).to_be_visible()


def choose(page: Page, label: str, option: str) -> None:
    """Choose in a list, as one types its beginning and presses Enter."""
    box = page.get_by_role("combobox", name=re.compile(re.escape(label))).first
    box.click()
    box.fill(option)
    page.get_by_role("option", name=option, exact=True).first.click()


@WIDTHS
def test_runs_are_found_and_compared_and_their_curves_changed(opened: BrowserPage) -> None:
    page = opened.page
    page.get_by_role("textbox", name="Search").fill("cut")
    page.get_by_role("textbox", name="Search").press("Enter")
    expect(page.get_by_text(re.compile("1 of 5 runs"))).to_be_visible()
    page.get_by_role("textbox", name="Search").fill("")
    page.get_by_role("textbox", name="Search").press("Enter")
    page.get_by_role("button", name="Draw all 5").click()
    legend = page.locator(".js-plotly-plot .legendtext")
    hostile = re.compile(r"Proposed, <img src=x\s*onerror=alert\(1\)>")  # on two lines
    for name in ("Proposed, long", "Proposed, cut", hostile):
        expect(legend.filter(has_text=name).first).to_be_visible()
    choose(page, "Quantity", "Best noise-free return so far (bps/Hz)")
    title = page.locator(".js-plotly-plot .ytitle").filter(has_text="Best noise-free")
    expect(title.first).to_be_visible()
    page.get_by_text("Follow trainings in progress").click()
    expect(page.get_by_role("switch")).not_to_be_checked()
    rest(page)  # or a renewal could come between the focus and the key
    smoothing = page.get_by_role("slider")
    smoothing.press("ArrowRight")
    expect(smoothing).to_have_value("26")
    expect(page.get_by_role("heading", name="What sets these runs apart")).to_be_visible()


def test_a_slow_browser_keeps_the_runs_that_are_drawn(
    context: BrowserContext, address: str
) -> None:
    with window(context, *DESKTOP) as opened:
        page = opened.page
        slowed = context.new_cdp_session(page)
        slowed.send("Emulation.setCPUThrottlingRate", {"rate": 5})
        with page.expect_websocket() as connected:
            page.goto(address)
        expect(page.get_by_text("Runs to draw")).to_be_visible()
        for _ in range(3):  # renewals, each of which tells what the browser holds as chosen
            connected.value.wait_for_event("framesent", timeout=PATIENCE)
        expect(page.locator(".js-plotly-plot .legendtext").first).to_be_visible()
        rest(page)
        expect(page.get_by_text("Choose options")).to_have_count(0)
        assert opened.errors == []


@WIDTHS
def test_a_flight_is_played_by_the_slider(opened: BrowserPage, size: tuple[int, int]) -> None:
    page = opened.page
    go_to(page, "Flights")
    kind = "wide" if size == DESKTOP else "narrow"
    plot = page.locator(f".st-key-player-{kind} .js-plotly-plot")
    expect(plot).to_be_visible()
    expect(plot.locator(".gtitle")).to_contain_text("slot 1 of 10")
    rest(page)
    rail = plot.locator(".slider-rail-touch-rect")
    rail.scroll_into_view_if_needed()
    box = rail.bounding_box()
    assert box is not None
    page.mouse.click(box["x"] + 0.98 * box["width"], box["y"] + box["height"] / 2)
    expect(plot.locator(".gtitle")).to_contain_text("slot 10 of 10")
    choose(page, "Scheme", "Re-optimum")
    title = plot.locator(".gtitle").filter(has_text="Re-optimum, slot 1 of 10: relay")
    expect(title).to_be_visible()
    expect(plot.locator(".gtitle")).to_have_count(1)  # the former flight has gone


@WIDTHS
def test_a_scenario_is_changed_flown_and_saved(
    opened: BrowserPage, runs: Path, size: tuple[int, int]
) -> None:
    page = opened.page
    go_to(page, "Scenario explorer")
    value = page.get_by_test_id("stMetricValue").first
    before = value.inner_text()
    page.get_by_role("tab", name="Radio").click()
    power = page.get_by_role("textbox", name="Jamming power (W)")
    power.fill("loud")
    power.press("Enter")
    expect(page.get_by_role("alert")).to_contain_text("jamming_power = 'loud': expected a number")
    power.fill("0.02")
    power.press("Enter")
    expect(page.get_by_role("alert")).to_have_count(0)
    expect(value).not_to_have_text(before)
    page.get_by_role("tab", name="Nodes").click()
    choose(page, "Node to move", "eavesdropper (E)")
    across = page.get_by_role("spinbutton", name="x (m)")
    expect(across).to_have_value("80")
    rest(page)  # or the map could be drawn anew under the click
    plot = page.locator(".js-plotly-plot").first
    plot.scroll_into_view_if_needed()
    box = plot.locator(".nsewdrag").bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + 0.25 * box["width"], box["y"] + 0.25 * box["height"])
    expect(plot.locator(".hovertext").first).to_be_visible()
    page.mouse.down()
    page.mouse.up()
    expect(across).not_to_have_value("80")
    choose(page, "Fly the checkpoint of", "tiny")
    expect(page.get_by_test_id("stMetricLabel").nth(1)).to_have_text("Proposed")
    page.get_by_text("UEs that can offload").click()
    expect(page.locator(".js-plotly-plot").get_by_text("of 10").first).to_be_visible()
    page.get_by_text("Save the scenario").click()
    name = f"moved_{size[0]}"
    page.get_by_role("textbox", name="Name", exact=True).fill(name)
    page.get_by_role("textbox", name="Name", exact=True).press("Enter")
    page.get_by_role("button", name="Save", exact=True).click()
    expect(page.get_by_text(f"scenario={name}")).to_be_visible()
    saved = load(runs, name)
    assert saved.jamming_power == 0.02
    assert -60.0 <= saved.eavesdropper_positions[0][0] <= -40.0
    assert 40.0 <= saved.eavesdropper_positions[0][1] <= 60.0


@WIDTHS
def test_a_map_of_regimes_tells_the_values_of_its_points(opened: BrowserPage) -> None:
    page = opened.page
    go_to(page, "Regimes")
    plot = page.locator(".js-plotly-plot").first
    expect(plot.locator(".legendtext").filter(has_text="Jamming")).to_be_visible()
    rest(page)
    plot.locator(".nsewdrag").hover()
    told = plot.locator(".hovertext")
    expect(told).to_contain_text("Hybrid with power control: ")
    expect(told).to_contain_text("bps/Hz")
    page.get_by_text("What power control adds").click()
    expect(plot.get_by_text("Times the best").first).to_be_visible()


@WIDTHS
def test_the_explorers_map_fills_its_figure(opened: BrowserPage) -> None:
    go_to(opened.page, "Scenario explorer")
    plot = opened.page.locator(".js-plotly-plot").first
    expect(plot.locator(".nsewdrag")).to_be_visible()
    rest(opened.page)
    frame, square = plot.bounding_box(), plot.locator(".nsewdrag").bounding_box()
    assert frame is not None
    assert square is not None
    below = frame["y"] + frame["height"] - square["y"] - square["height"]
    assert 20 < below < 70  # the title of its axis
    assert square["height"] > 0.65 * frame["width"]
    assert opened.page.locator(".js-plotly-plot .legend").first.is_visible()


@WIDTHS
def test_an_empty_directory_is_followed_from_the_first_episode(
    context: BrowserContext, size: tuple[int, int], tmp_path: Path
) -> None:
    root = tmp_path / "runs"
    arguments = (
        *("training.num_episodes=20000", "training.batch_size=8", "algorithm.hidden_sizes=[8]"),
        *("training.compile=never", "training.cohorts=1", "scenario.num_slots=3"),
        *("logger.mode=disabled", "hydra.run.dir=live"),
    )
    with dashboard(root) as (address, _), window(context, *size) as opened:
        page = opened.page
        page.goto(address)
        expect(page.get_by_text("No runs in")).to_be_visible()
        go_to(page, "Flights")
        expect(page.get_by_text("No run in")).to_be_visible()
        go_to(page, "Scenario explorer")
        expect(page.locator(".js-plotly-plot .nsewdrag")).to_be_visible()
        go_to(page, "Runs")
        root.mkdir()
        with recipe("train", *arguments, cwd=root):
            progress = page.get_by_text(re.compile(r"live: episode \d+ of 20000"))
            before = progress.inner_text()
            expect(progress).not_to_have_text(before)
            expect(page.locator(".js-plotly-plot .legendtext").first).to_be_visible()
        assert opened.errors == []
        assert opened.refused == []
