"""What the benchmark ran on."""

import importlib.metadata
import platform
from pathlib import Path
from typing import Any

import torch

from hyuav._support.machine import cores

PACKAGES = ("hyuav", "torch", "torchrl", "stable_baselines3", "sbx-rl", "jax", "numpy")


def facts() -> dict[str, Any]:
    """Processor, cores, GPU, Python and the versions of the libraries."""
    return {
        "processor": _processor(),
        "cores": cores(),
        "gpu": torch.cuda.get_device_name() if torch.cuda.is_available() else None,
        "system": platform.platform(),
        "python": platform.python_version(),
        "versions": {package: _version(package) for package in PACKAGES},
    }


def _processor() -> str:
    """The processor's name; Python's own answer is empty on Linux."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def _version(package: str) -> str | None:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None
