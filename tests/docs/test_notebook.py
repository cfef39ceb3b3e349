"""The notebook runs as it stands, from top to bottom, in a kernel of its own."""

import copy
import os
import sys
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

NOTEBOOK = Path(__file__).parents[2] / "examples" / "quickstart.ipynb"


@pytest.fixture(scope="module")
def kept() -> nbformat.NotebookNode:
    """The notebook as readers see it, with what came of the whole training."""
    return nbformat.read(NOTEBOOK, as_version=4)


@pytest.mark.slow
def test_it_runs_from_top_to_bottom(
    kept: nbformat.NotebookNode, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HYUAV_NOTEBOOK_EPISODES", "4")
    monkeypatch.delenv("MPLBACKEND", raising=False)  # Streamlit, once imported, sets it
    scripts = str(Path(sys.executable).parent)  # where the command is
    monkeypatch.setenv("PATH", os.pathsep.join([scripts, os.environ["PATH"]]))
    resources = {"metadata": {"path": str(tmp_path)}}
    fresh = copy.deepcopy(kept)
    client = NotebookClient(fresh, timeout=600, kernel_name="python3", resources=resources)
    ran = client.execute()
    outputs = [output for cell in ran.cells for output in cell.get("outputs", ())]
    assert not [each for each in outputs if each.output_type == "error"]
    assert not [each for each in outputs if each.get("name") == "stderr"]
    assert sum("image/png" in each.get("data", {}) for each in outputs) == 3
    assert (tmp_path / "runs" / "notebook" / "report.html").is_file()


def test_it_is_kept_small_with_its_pictures_and_without_faults(
    kept: nbformat.NotebookNode,
) -> None:
    nbformat.validate(kept)
    assert NOTEBOOK.stat().st_size < 200_000
    outputs = [output for cell in kept.cells for output in cell.get("outputs", ())]
    assert sum("image/png" in each.get("data", {}) for each in outputs) == 3
    printed = "".join(each.get("text", "") for each in outputs)
    assert "Proposed" in printed
    assert "\x1b" not in printed
    assert str(Path.home()) not in NOTEBOOK.read_text(encoding="utf-8")


def test_it_installs_the_library_only_where_that_is_missing(kept: nbformat.NotebookNode) -> None:
    first = next(cell for cell in kept.cells if cell.cell_type == "code")
    condition, command = first.source.splitlines()[-2:]
    assert condition == 'if importlib.util.find_spec("hyuav") is None:'
    assert command.strip() == "%pip install --quiet hyuav"
