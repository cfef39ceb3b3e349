"""Write the report of a run, a comparison or a map of regimes: one HTML file, whole in itself."""

from pathlib import Path

from hyuav._support.errors import InputError, rejection
from hyuav._support.files import require_writable, write_durably
from hyuav.experiments.run_directory import REPORT_FILE
from hyuav.viz.data.comparison import is_comparison
from hyuav.viz.data.regimes import is_map
from hyuav.viz.html.comparison import comparison_page
from hyuav.viz.html.document import render
from hyuav.viz.html.regimes import regimes_page
from hyuav.viz.html.run import run_page


def write_report(directory: str | Path) -> Path:
    """Write ``report.html`` into the directory of a run, a comparison or a map; tell its path.

    Each may be unfinished; what is missing or damaged is left out, and the page says so.

    Args:
        directory: as :class:`hyuav.experiments.run_directory.RunDirectory`,
            :class:`hyuav.experiments.comparison.directory.ComparisonDirectory` or
            :class:`hyuav.experiments.regimes.work.RegimeDirectory` has it.

    Raises:
        InputError: there is no such directory, or it cannot be written to.
        OSError: the report cannot be written, for want of space perhaps; then an earlier one is
            still there.
    """
    path = Path(directory)
    if not path.is_dir():
        raise InputError(rejection("run", str(path), "an existing directory"))
    require_writable("run", path)
    kinds = {regimes_page: is_map, comparison_page: is_comparison}
    page = next((page for page, holds in kinds.items() if holds(path)), run_page)(path)
    write_durably(path / REPORT_FILE, render(page).encode("utf-8", errors="replace"))
    return path / REPORT_FILE
