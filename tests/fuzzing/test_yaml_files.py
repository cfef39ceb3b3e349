"""Hostile YAML: read as data or refused in one line, whatever it asks for."""

from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from omegaconf import OmegaConf

from hostile import CASES, TRIED, attempt, fuzz, mutated, texts
from hyuav import InputError, Scenario
from hyuav._support.yaml_files import DEEPEST_YAML, LARGEST_YAML, read_yaml
from hyuav.viz.data.configuration import differences
from hyuav.viz.data.index import RunIndex
from hyuav.viz.data.reading import readable_config
from hyuav.viz.html.tables import configuration_tables

SAVED = OmegaConf.to_yaml(Scenario.preset("random_disk").to_dict()).encode()

TRICKS = (
    "a: &a [x,x]\nb: &b [*a,*a]\nc: [*b,*b]\n",
    "a: &a {x: 1}\nb: {<<: *a}\n",
    "a: &a [*a]\n",
    "a: !!python/object/apply:os.system [touch hacked]\n",
    "a: !!python/name:os.system\n",
    "a: !!python/object/new:os.system [touch hacked]\n",
    "!!python/object/apply:subprocess.Popen [[touch, hacked]]\n",
    "a: ${oc.env:HOME}\n",
    "a: ${b}\nb: ${a}\n",
    "a: ${oc.decode:1}\n",
    "a: ${\n",
    "a: ???\n",
    "num_slots: 0x" + "f" * 5000 + "\n",
    "num_slots: " + "9" * 5000 + "\n",
    "num_slots: 190:20:30\n",
    "a: !!binary aGk=\n",
    "a: !!set {x}\n",
    "? [1, 2]\n: 3\n",
    "null: 3\ntrue: 4\n1.5: 5\n",
    "a: 1\na: 2\n",
    "--- 1\n--- 2\n",
    "a: 2001-01-01\n",
    "%YAML 9.9\n---\na: 1\n",
    "[" * 300,
    "{a: " * 300,
    "- " * 300,
    "? " * 300,
)

lines = st.lists(
    st.sampled_from(TRICKS)
    | st.builds(lambda name, value: f"{name}: {value}\n", texts, texts)
    | st.builds(lambda depth: "a: " + "[" * depth + "]" * depth + "\n", st.integers(1, 200)),
    min_size=1,
    max_size=3,
).map(lambda parts: "".join(parts).encode("utf-8", "surrogatepass"))


def read_everywhere(path: Path) -> dict[str, Any]:
    """By all that read a configuration, with what is made of it."""
    config = readable_config(path.parent)
    assert len(configuration_tables(config)) < 100 * LARGEST_YAML
    index = RunIndex(path.parent.parent)
    shown = index.configuration(path.parent.name)
    assert "python/" not in type(shown).__name__
    differences({"one": shown, "other": {}})
    list(index.entries())
    return read_yaml(path)


@pytest.mark.slow
def test_a_hostile_yaml_file_is_read_as_data_or_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kind = "YAML file"
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HOME", "a-secret")
    path = tmp_path / "runs" / "run" / "config.yaml"
    path.parent.mkdir(parents=True)
    (path.parent / "metrics.csv").write_text("")

    @fuzz(kind)
    @given(lines | mutated(SAVED) | st.binary(max_size=60))
    def try_one(content: bytes) -> None:
        path.write_bytes(content)
        values = attempt(kind, lambda: read_everywhere(path))
        assert "a-secret" not in str(values)
        attempt("scenario file", lambda: Scenario.load(path))

    try_one()
    assert not (tmp_path / "hacked").exists()
    assert sum(TRIED[kind, outcome] for outcome in ("worked", "refused")) >= CASES[kind]


@pytest.mark.parametrize("text", TRICKS)
def test_a_trick_is_not_obeyed(tmp_path: Path, text: str) -> None:
    path = tmp_path / "run" / "config.yaml"
    path.parent.mkdir()
    (path.parent / "metrics.csv").write_text("")
    path.write_text(text)
    attempt("trick", lambda: read_everywhere(path))
    with pytest.raises(InputError, match=r"^[^\n]+$"):
        Scenario.load(path)


def test_a_few_lines_do_not_become_gigabytes(tmp_path: Path) -> None:
    names = "abcdefghijklmnop"
    bomb = "a: &a [x,x,x,x,x,x,x,x,x,x]\n" + "".join(
        f"{name}: &{name} [{','.join([f'*{before}'] * 10)}]\n" for before, name in pairwise(names)
    )
    (tmp_path / "config.yaml").write_text(bomb)
    with pytest.raises(InputError, match=r"^cannot be read \(it has aliases\)$"):
        read_yaml(tmp_path / "config.yaml")
    assert readable_config(tmp_path) == {}
    assert RunIndex(tmp_path).configuration(".") == {}


@pytest.mark.parametrize("opening", ["[", "{a: ", "- ", "? "])
def test_no_depth_exhausts_the_stack(tmp_path: Path, opening: str) -> None:
    path = tmp_path / "config.yaml"
    path.write_text(opening * 200_000)
    with pytest.raises(InputError, match=rf"nested more than {DEEPEST_YAML} times|^cannot be read"):
        read_yaml(path)
    assert RunIndex(tmp_path).configuration(".") == {}


def test_no_size_exhausts_the_memory(tmp_path: Path) -> None:
    path = tmp_path / "config.yaml"
    path.write_bytes(b"# " + b"x" * LARGEST_YAML)
    with pytest.raises(InputError, match=r"^cannot be read \(larger than"):
        read_yaml(path)


def test_what_is_no_file_is_not_waited_for(tmp_path: Path) -> None:
    for name, target in (("zero", "/dev/zero"), ("self", "self")):
        (tmp_path / name).symlink_to(target)
        with pytest.raises(InputError, match=r"^cannot be read"):
            read_yaml(tmp_path / name)
