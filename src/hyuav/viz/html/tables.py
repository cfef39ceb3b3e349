"""Tables of a report as HTML, in which everything that was read from a file is escaped."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import pandas as pd
from markupsafe import Markup, escape

from hyuav._support.formatting import bounds, or_never, percent
from hyuav.experiments.comparison.tables import label
from hyuav.experiments.evaluation_table import (
    earned_title,
    flight_cells,
    is_bounded,
    upper_bounds,
)
from hyuav.experiments.schemes import NO_HELPER
from hyuav.viz.data.configuration import SYMBOLS, entries
from hyuav.viz.data.schemes import scheme_color, scheme_label


def html_table(
    caption: str, headings: Sequence[str], rows: Iterable[Sequence[object]], *, text: int = 1
) -> Markup:
    """A table that scrolls sideways where the page is narrow; cells of Markup may wrap.

    Args:
        caption: above it.
        headings: of the columns.
        rows: of cells; whatever is not Markup is escaped.
        text: how many columns hold text; the others hold numbers, aligned to the right.
    """
    head = Markup("").join(
        Markup('<th scope="col" class="{}">{}</th>').format("" if place < text else "number", name)
        for place, name in enumerate(headings)
    )
    body = Markup("").join(
        Markup("<tr>{}</tr>").format(
            Markup("").join(_cell(cell, place, text) for place, cell in enumerate(row))
        )
        for row in rows
    )
    return Markup(
        '<div class="table" tabindex="0" role="region" aria-label="{}"><table>'
        "<caption>{}</caption><thead><tr>{}</tr></thead><tbody>{}</tbody></table></div>"
    ).format(caption, caption, head, body)


def _cell(cell: object, place: int, text: int) -> Markup:
    if place == 0:
        return Markup('<th scope="row">{}</th>').format(cell)
    kind = "number" if place >= text else "wraps" if isinstance(cell, Markup) else ""
    return Markup('<td class="{}">{}</td>').format(kind, cell)


def scheme_table(summary: Mapping[str, Any]) -> Markup:
    """What each scheme earned and spent.

    Args:
        summary: as :attr:`hyuav.experiments.evaluation.Evaluation.summary`.
    """
    swatch = Markup('<span class="swatch" style="background:{}"></span>{}')
    bounded = is_bounded(summary)
    rows = [
        (
            swatch.format(scheme_color(scheme), scheme_label(scheme)),
            *flight_cells(result, bounded=bounded),
            f"{1e3 * result['ue_energy']:.1f}",
            f"{result['edge_energy']:.1f}",
            f"{result['helper_energy'] / 1e3:.2f}",
            f"{result['budget_violations']:.2f}",
        )
        for scheme, result in summary["schemes"].items()
    ]
    caption = (
        f"T = {summary['num_slots']}: mean of {summary['episodes']} episodes on the same fading, "
        "with the 95 % interval; energies per episode"
    )
    if bounded:
        caption += f"; {upper_bounds(summary)}"
    hybrid = "of own upper bound" if bounded else "of hybrid optimum"
    headings = (
        *("Scheme", earned_title(summary), f"of own {'lower bound' if bounded else 'optimum'}"),
        "Secrecy sum-rate (bps/Hz)" if "reward" in summary else hybrid,
        *("Relay slots", "UEs offloading", "Off map", "Energy per UE (mJ)"),
        *("Energy of L (J)", "Energy of H (kJ)", "Budgets exceeded"),
    )
    return html_table(caption, headings, rows)


def cells_table(cells: pd.DataFrame, threshold: float) -> Markup:
    """What the learners of each cell of a comparison reached.

    Args:
        cells: as :func:`.statistics.summarize_cells` gives them.
        threshold: share of the optimum that counts as solved.
    """
    rows = [
        (
            label(str(cell["algorithm"])),
            *(cell[name] for name in ("scenario", "scheme", "num_slots", "learners")),
            f"{100 * cell['iqm']:.1f}",
            bounds(100 * cell["low"], 100 * cell["high"], 1),
            f"{100 * cell['worst']:.1f}",
            percent(cell["above_threshold"], 0),
            or_never(cell["median_episodes_to_threshold"], 0),
            or_never(cell["median_seconds_to_threshold"], 1),
            percent(cell["no_helper"]) if pd.notna(cell["no_helper"]) else "-",
        )
        for _, cell in cells.iterrows()
    ]
    headings = (
        *("Algorithm", "Scenario", "Scheme", "T", "Learners", "IQM (%)", "95 % interval"),
        *("Worst (%)", f"reach {percent(threshold, None)}", "Episodes until then", "Seconds (s)"),
        scheme_label(NO_HELPER),
    )
    caption = "Share of the optimum: interquartile mean (IQM) over the learners of each cell"
    return html_table(caption, headings, rows, text=3)


def algorithms_table(algorithms: pd.DataFrame, threshold: float) -> Markup:
    """What the learners of each algorithm reached over all cells.

    Args:
        algorithms: as :func:`.statistics.summarize_algorithms` gives them.
        threshold: share of the optimum that counts as solved.
    """
    rows = [
        (
            label(str(row["algorithm"])),
            row["learners"],
            f"{100 * row['iqm']:.1f}",
            bounds(100 * row["low"], 100 * row["high"], 1),
            *(f"{100 * row[name]:.1f}" for name in ("median", "worst")),
            *(percent(row[name], 0) for name in ("near_optimal", "above_threshold")),
            f"{row['seconds']:.1f}",
        )
        for _, row in algorithms.iterrows()
    ]
    headings = (
        *("Algorithm", "Learners", "IQM (%)", "95 % interval", "Median (%)", "Worst (%)"),
        *("reach 95 %", f"reach {percent(threshold, None)}", "Median time (s)"),
    )
    return html_table("Share of the optimum over all cells", headings, rows)


def configuration_tables(config: Mapping[str, Any]) -> Markup:
    """The configuration, a table for each of its sections.

    Args:
        config: nested plain values, as in ``config.yaml``.
    """
    sections: dict[str, list[tuple[object, ...]]] = {}
    for name, value in config.items():
        section = str(name) if isinstance(value, Mapping) else "general"
        sections.setdefault(section, []).extend(
            (entry, _value(content), SYMBOLS.get(entry, ""))
            for entry, content in entries(value, str(name))
        )
    return Markup("").join(
        Markup("<details{}><summary>{} ({} entries)</summary>{}</details>").format(
            Markup(" open") if name == "general" else "",
            name,
            len(rows),
            html_table(name, *_with_units(rows), text=3),
        )
        for name, rows in sections.items()
    )


def _with_units(
    rows: list[tuple[object, ...]],
) -> tuple[tuple[str, ...], list[tuple[object, ...]]]:
    """The headings and rows, without the last column where it is empty."""
    if any(unit for _, _, unit in rows):
        return ("Parameter", "Value", "Symbol and unit"), rows
    return ("Parameter", "Value"), [row[:2] for row in rows]


def _value(value: object) -> Markup:
    if isinstance(value, list) and any(isinstance(entry, Mapping) for entry in value):
        return Markup("<br>").join(_text(entry) for entry in value)
    return escape(_text(value))


def _text(value: object) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{key}: {_text(entry)}" for key, entry in value.items())
    if isinstance(value, list):
        inner = ", ".join(_text(entry) for entry in value)
        return f"({inner})" if value and not isinstance(value[0], list) else inner or "none"
    if isinstance(value, float):
        return f"{value:.6g}"
    return (
        "none" if value is None else str(value).lower() if isinstance(value, bool) else str(value)
    )
