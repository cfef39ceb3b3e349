"""Configuration files for Hydra that are data: nothing in them is run, looked up or obeyed."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from hydra._internal.core_plugins import file_config_source
from hydra._internal.sources_registry import SourcesRegistry
from hydra.core.plugins import Plugins
from hydra.plugins.config_source import ConfigResult

from hyuav._support.errors import InputError, brief, rejection
from hyuav._support.yaml_files import read_yaml

ORDERS = ("defaults", "hydra", "_target_")
"""Names under which Hydra takes orders: what else to read, where to write, what to call."""


def read_files_as_data() -> None:
    """From now on Hydra reads files, as those of ``--config-dir``, by :class:`FileConfigSource`.

    So do the workers of its launchers, to which Hydra hands over what is registered.
    """
    Plugins.instance()  # which registers Hydra's own way when it is made
    SourcesRegistry.instance().types[FileConfigSource.scheme()] = FileConfigSource


class FileConfigSource(file_config_source.FileConfigSource):
    """Files that hold names with plain values, as :meth:`.Parameters.save` writes.

    It bears the name of Hydra's own, which a worker would otherwise not find in its place.

    Hydra would let a file call any function (``hydra.callbacks``), write anywhere
    (``hydra.run.dir``) and copy the environment (``${oc.env:...}``), which is not to be expected of
    a scenario that somebody sent.
    """

    def load_config(self, config_path: str) -> ConfigResult:
        """Read a file.

        Raises:
            InputError: it cannot be read, or there is more than plain values in it.
        """
        path = Path(self.path) / self._normalize_file_name(config_path)
        try:
            values = read_yaml(path)
        except InputError as error:
            raise InputError(f"configuration file {brief(str(path))}: {error}") from None
        result = super().load_config(config_path)
        if result.header.get("package") is not None:
            raise _refusal(path, "@package")
        for text in _texts(values):
            if text in ORDERS or "${" in text:
                raise _refusal(path, text)
        return result


def _refusal(path: Path, text: str) -> InputError:
    return InputError(rejection("configuration file", str(path), f"no {brief(text)} in it"))


def _texts(value: Any) -> Iterator[str]:
    """Every name, and every text among the values."""
    if isinstance(value, dict):
        for name, entry in value.items():
            yield str(name)
            yield from _texts(entry)
    elif isinstance(value, list):
        for entry in value:
            yield from _texts(entry)
    elif isinstance(value, str):
        yield value
