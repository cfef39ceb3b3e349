"""Reports as a person opens them: from the disk, on a desktop's and on a phone's screen."""

import re
import shutil
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

import pandas as pd
import pytest
from playwright.sync_api import BrowserContext, Page

from browser import DESKTOP, PHONE, browser, needs_chromium, window
from hyuav.experiments.comparison.plan import PIECES
from hyuav.experiments.comparison.shards import CURVES_FILE, RESULTS_FILE
from hyuav.experiments.metrics import METRIC_COLUMNS
from hyuav.experiments.run_directory import RunDirectory
from hyuav.experiments.schemes import LABELS
from hyuav.viz.data.reading import readable_flights
from hyuav.viz.html.page import write_report
from recipe_calls import TINY_COMPARISON, Call

pytest_plugins = "sample_runs"
pytestmark = needs_chromium

Copy = Callable[[RunDirectory], RunDirectory]
BOTH = pytest.mark.parametrize("screen", [DESKTOP, PHONE], ids=["desktop", "phone"])
HOSTILE = "<script>alert(1)</script> \"a\" 'b' <img src=x onerror=alert(2)>"

TITLE = "figure[aria-label='Flight'] .gtitle"

# What stands outside its figure, or on top of another part of it.
MISPLACED = """() => [...document.querySelectorAll('.js-plotly-plot')].flatMap((plot) => {
  const frame = plot.getBoundingClientRect();
  const box = (part) => part.getBoundingClientRect();
  const cut = [...plot.querySelectorAll('text')].filter((text) => {
    const own = box(text);
    return text.textContent && own.width && (own.left < frame.left - 1 ||
      own.right > frame.right + 1 || own.top < frame.top - 1 || own.bottom > frame.bottom + 1);
  }).map((text) => 'cut off: ' + text.textContent);
  const parts = ['.gtitle', '.legend', '.slider-container', '.updatemenu-container', '.bglayer',
    '.xtitle', '.x2title', '.x3title', '.x4title', '.ytitle', '.y2title', '.y3title', '.y4title']
    .filter((name) => name !== '.bglayer')
    .flatMap((name) => [...plot.querySelectorAll(name)].map((part) => [name, box(part)]))
    .concat([...plot.querySelectorAll('.cartesianlayer .subplot > .gridlayer')]
      .map((part) => ['panel', box(part)]))
    .filter(([, own]) => own.width && own.height);
  const over = parts.flatMap(([name, own], index) => parts.slice(index + 1)
    .filter(([, other]) => own.left < other.right - 1 && other.left < own.right - 1 &&
      own.top < other.bottom - 1 && other.top < own.bottom - 1)
    .map(([other]) => name + ' on ' + other));
  return [...cut, ...over];
})"""


@pytest.fixture(scope="module")
def report(evaluated: RunDirectory) -> Path:
    """Of an evaluated run."""
    return write_report(evaluated.path)


Opened = Callable[[Path, tuple[int, int]], AbstractContextManager[Page]]


@pytest.fixture(scope="module")
def context() -> Iterator[BrowserContext]:
    """A browser for all tests of this file."""
    with browser() as context:
        yield context


@pytest.fixture
def opened(context: BrowserContext) -> Opened:
    """Open a report, all of its figures drawn; at the end nothing may have gone wrong."""

    @contextmanager
    def open_report(path: Path, screen: tuple[int, int]) -> Iterator[Page]:
        with window(context, *screen) as watched:
            page = watched.page
            page.goto(path.as_uri())
            page.wait_for_function(
                "[...document.querySelectorAll('figure.picture')].every((own) => own.dataset.drawn)"
            )
            yield page
            assert watched.errors == []
            assert watched.refused == []

    return open_report


def _width(page: Page) -> int:
    return int(page.evaluate("document.documentElement.scrollWidth"))


def _slide(page: Page, share: float) -> None:
    """Press the slider's rail at a share of its length."""
    rail = page.locator(".slider-rail-touch-rect").first
    rail.scroll_into_view_if_needed()
    box = rail.bounding_box()
    assert box is not None
    page.mouse.click(box["x"] + share * box["width"], box["y"] + box["height"] / 2)


def _filled(page: Page) -> int:
    """How many UEs on the map are drawn filled."""
    black, points = "rgb(0, 0, 0)", "figure[aria-label='Flight'] .scatterlayer .point"
    styles: list[str] = page.locator(points).evaluate_all(
        "(points) => points.map((point) => getComputedStyle(point).fill)"
    )
    return styles.count(black)


@BOTH
def test_the_slider_shows_each_slot_as_it_was_flown(
    screen: tuple[int, int], evaluated: RunDirectory, report: Path, opened: Opened
) -> None:
    flights = readable_flights(evaluated.path)
    assert flights is not None
    rows = flights[(flights["scheme"] == "optimum") & (flights["episode"] == 0)]
    with opened(report, screen) as page:
        assert _width(page) == screen[0]
        page.get_by_label("Flight").locator("select").select_option(label="Optimum")
        for slot in (12, 2, 7):
            _slide(page, 0.02 + 0.96 * (slot - 1) / 11)
            row = rows[rows["slot"] == slot].iloc[0]
            mode, senders = "relay" if row["relay"] else "jamming", int(sum(row["offloading"]))
            page.locator(TITLE, has_text=f"Optimum, slot {slot} of 12: {mode}").wait_for()
            told = page.locator(TITLE).text_content()
            assert told is not None
            assert f"{senders} of 10 UEs offload, {row['secrecy_sum_rate']:.2f} bps/Hz" in told
            assert _filled(page) == senders
        assert page.evaluate(MISPLACED) == []


def test_every_scheme_can_be_chosen(report: Path, opened: Opened) -> None:
    with opened(report, PHONE) as page:
        select = page.get_by_label("Flight").locator("select")
        names = select.locator("option").all_text_contents()
        assert {"Proposed", "Re-OT", "Re-LT", "Ja-LT", "Optimum"} <= set(names)
        assert names == [label for label in LABELS.values() if label in names]
        for name in ("Re-LT", "Ja-LT"):
            select.select_option(label=name)
            page.locator(TITLE, has_text=f"{name}, slot 1 of 12").wait_for()


def test_playing_moves_on_and_the_slider_may_be_moved_meanwhile(
    report: Path, opened: Opened
) -> None:
    with opened(report, DESKTOP) as page:
        page.get_by_text("▶ Play").click()
        # Any of several slots, since a busy machine may be seen to leave one out.
        page.locator(TITLE, has_text=re.compile("slot [3-9] of 12")).wait_for()
        _slide(page, 0.98)
        page.locator(TITLE, has_text="slot 12 of 12").wait_for()
        page.get_by_text("▶ Play").click()  # from the first slot again
        page.locator(TITLE, has_text=re.compile("slot [2-9] of 12")).wait_for()
        page.get_by_text("Pause").click()


@BOTH
def test_an_unevaluated_run_is_flown_and_nothing_is_misplaced(
    screen: tuple[int, int], trained: RunDirectory, copied: Copy, opened: Opened
) -> None:
    with opened(write_report(copied(trained).path), screen) as page:
        assert _width(page) == screen[0]
        assert page.evaluate(MISPLACED) == []
        assert page.locator("text=Nothing was evaluated yet").count() == 2
        page.locator(TITLE, has_text="Proposed, slot 1 of 12").wait_for()
        table = page.locator("section[aria-labelledby='schemes'] tbody th")
        assert table.all_text_contents() == ["Proposed", "Re-OT", "Re-LT", "Ja-LT", "No helper"]


def test_hostile_names_stay_text(evaluated: RunDirectory, copied: Copy, opened: Opened) -> None:
    run = copied(evaluated)
    config = run.config_file.read_text()
    quoted = HOSTILE.replace('"', '\\"')
    run.config_file.write_text(config.replace("two_clusters", f'"{quoted}"'))
    with opened(write_report(run.path), DESKTOP) as page:
        assert HOSTILE in (page.locator("header").text_content() or "")
        assert page.locator("img").count() == 0
        captions = page.locator("figure.small figcaption").all_text_contents()
        assert captions[0] == f"Relay, {HOSTILE}"


def _cut_off(run: RunDirectory) -> None:
    run.metrics_file.write_bytes(run.metrics_file.read_bytes()[:-17])
    run.best_checkpoint.unlink()


def _being_written(run: RunDirectory) -> None:
    run.metrics_file.write_text(",".join(METRIC_COLUMNS) + "\n")
    run.best_checkpoint.write_bytes(run.best_checkpoint.read_bytes()[:1000])


def _long(run: RunDirectory) -> None:
    row = "{episode},20,0,hybrid,3,12,{reward},,,,0.1\n"
    rows = [row.format(episode=n, reward=n % 97) for n in range(1, 100_001)]
    run.metrics_file.write_text(",".join(METRIC_COLUMNS) + "\n" + "".join(rows))


@pytest.mark.parametrize(
    ("damage", "told"),
    [
        (_cut_off, "Episodes done 4 "),
        (_being_written, "No episode was logged yet."),
        (_long, "Episodes done 100000 "),
    ],
)
def test_a_run_in_any_state_opens(
    damage: Callable[[RunDirectory], None],
    told: str,
    trained: RunDirectory,
    copied: Copy,
    opened: Opened,
) -> None:
    run = copied(trained)
    damage(run)
    with opened(write_report(run.path), PHONE) as page:
        assert told in re.sub(r"\s+", " ", page.locator("body").inner_text())
        assert page.evaluate(MISPLACED) == []
        assert page.locator("h2").count() == 5


@pytest.mark.parametrize("folder", ["", "shards"], ids=["run", "comparison"])
def test_an_empty_directory_opens(folder: str, tmp_path: Path, opened: Opened) -> None:
    (tmp_path / "empty" / folder).mkdir(parents=True)
    with opened(write_report(tmp_path / "empty"), PHONE) as page:
        notes = page.locator(".note").all_text_contents()
        assert len(notes) == page.locator("h2").count()


@BOTH
def test_an_ablation_with_many_pieces_is_legible(
    tmp_path: Path, screen: tuple[int, int], opened: Opened
) -> None:
    entries = ["ddpg_robust", *(f"ddpg_robust-{piece}" for piece in PIECES)]
    learner = {"scenario": "two_clusters", "scheme": "hybrid", "num_slots": 10, "seed": 0}
    rows = [
        {"algorithm": entry, **learner, "episode": episode, "fraction": 0.9 + 0.001 * episode}
        for entry in entries
        for episode in (10, 20)
    ]
    unknown = {"episodes_to_threshold": None, "seconds_to_threshold": None, "seconds": 1.0}
    pd.DataFrame(rows).assign(**unknown).to_parquet(tmp_path / RESULTS_FILE)
    pd.DataFrame(rows).to_parquet(tmp_path / CURVES_FILE)
    with opened(write_report(tmp_path), screen) as page:
        misplaced = page.evaluate(MISPLACED)
        if screen == PHONE:  # there the legend scrolls
            scrolled = ("cut off: without", "cut off: worst")
            misplaced = [part for part in misplaced if not part.startswith(scrolled)]
        assert misplaced == []
        legend = page.locator("figure").first.locator(".legendtext")
        assert legend.count() == len(entries) + 1


def test_a_comparison_opens(call: Call, tmp_path: Path, opened: Opened) -> None:
    asked = ("algorithm=[ddpg,sac]", "scenario=two_clusters", "scheme=[hybrid,relay]")
    call("compare", *asked, *TINY_COMPARISON)
    here = tmp_path / "here"
    for screen in (DESKTOP, PHONE):
        with opened(here / "report.html", screen) as page:
            assert _width(page) == screen[0]
            assert page.evaluate(MISPLACED) == []
            select = page.get_by_label("Flight").locator("select")
            assert select.locator("option").all_text_contents() == [
                f"{name}, two_clusters, T = 8, Proposed" for name in ("DDPG", "SAC")
            ]
            _slide(page, 0.98)
            page.locator(TITLE, has_text="slot 8 of 8").wait_for()
    shutil.rmtree(here / "shards" / "sac_two_clusters_T8")
    with opened(write_report(here), DESKTOP) as page:
        assert page.locator("header dd").all_text_contents()[1] == "DDPG"
