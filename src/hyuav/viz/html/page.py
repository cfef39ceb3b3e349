"""Write the report of a run or of a comparison: one HTML file that needs nothing else."""

from collections.abc import Callable
from pathlib import Path

from hyuav._support.errors import InputError, rejection
from hyuav.experiments.run_directory import REPORT_FILE, require_writable
from hyuav.viz.data.reading import readable_config
from hyuav.viz.html.comparison import comparison_page
from hyuav.viz.html.html import Page, write_page
from hyuav.viz.html.run import run_page


def write_run_report(directory: str | Path) -> Path:
    """Write ``report.html`` into a run's directory, and tell its path.

    The run may be unfinished; what is missing or damaged is left out, and the page says so.

    Args:
        directory: as :class:`hyuav.experiments.run_directory.RunDirectory` has it.

    Raises:
        InputError: there is no such directory, or it cannot be written to.
        OSError: the report cannot be written, for want of space perhaps.
    """
    return _write(directory, run_page)


def write_comparison_report(directory: str | Path) -> Path:
    """Write ``report.html`` into a comparison's directory, and tell its path.

    Args:
        directory: as :class:`.ComparisonDirectory` has it, with any
            number of finished trainings.

    Raises:
        InputError: there is no such directory, or it cannot be written to.
        OSError: the report cannot be written, for want of space perhaps.
    """
    return _write(directory, comparison_page)


def write_report(directory: str | Path) -> Path:
    """Write the report of whichever of both the directory holds.

    Raises:
        InputError: there is no such directory, or it cannot be written to.
        OSError: the report cannot be written, for want of space perhaps.
    """
    path = Path(directory)
    compares = (path / "shards").is_dir() or "hyperparameters" in readable_config(path)
    return write_comparison_report(path) if compares else write_run_report(path)


def _write(directory: str | Path, page: Callable[[Path], Page]) -> Path:
    path = Path(directory)
    if not path.is_dir():
        raise InputError(rejection("run", str(path), "an existing directory"))
    require_writable("run", path)
    return write_page(page(path), path / REPORT_FILE)
