"""``hydra/launcher=ray``: the jobs of a multirun on a local Ray, or on a cluster by its address.

It stands in for the package hydra-ray-launcher, whose requirements (boto3, of all versions of Ray
the one with a dashboard) exclude versions that this project builds on.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hydra.core.config_store import ConfigStore
from hydra.core.singleton import Singleton
from hydra.core.utils import JobReturn, JobStatus, run_job, setup_globals
from hydra.plugins.launcher import Launcher
from hydra.types import HydraContext, TaskFunction
from omegaconf import DictConfig, open_dict


@dataclass
class RayLauncherConf:
    """What ``hydra.launcher`` holds."""

    _target_: str = "hydra_plugins.hyuav_ray_launcher.RayLauncher"
    address: str = "local"
    """As :func:`hyuav.experiments.cluster.connected` takes it."""
    workers: int | None = None
    """Of a local Ray; one for each core where it is None."""


ConfigStore.instance().store(
    group="hydra/launcher", name="ray", node=RayLauncherConf, provider="hyuav"
)


class RayLauncher(Launcher):
    """Run every job of a multirun as a task of Ray; one that fails stops no other.

    Args:
        address: of Ray.
        workers: of a local one.
    """

    def __init__(self, address: str, workers: int | None) -> None:
        self._address, self._workers = address, workers

    def setup(
        self, *, hydra_context: HydraContext, task_function: TaskFunction, config: DictConfig
    ) -> None:
        """Be told what the jobs have in common."""
        self._context, self._task, self._config = hydra_context, task_function, config

    def launch(
        self, job_overrides: Sequence[Sequence[str]], initial_job_idx: int
    ) -> Sequence[JobReturn]:
        """Run the jobs; what became of each, in their order."""
        from hyuav._support.machine import cores
        from hyuav.experiments.cluster import (  # this module is imported by every command
            connected,
            outcomes,
        )

        setup_globals()
        directory = Path(str(self._config.hydra.sweep.dir)).absolute()
        directory.mkdir(parents=True, exist_ok=True)
        configurations = [
            self._configuration(list(overrides), number, directory)
            for number, overrides in enumerate(job_overrides, initial_job_idx)
        ]
        context, task, state = self._context, self._task, Singleton.get_state()

        def run(index: int) -> JobReturn:
            setup_globals()
            Singleton.set_state(state)
            return run_job(
                task_function=task,
                config=configurations[index],
                job_dir_key="hydra.sweep.dir",
                job_subdir_key="hydra.sweep.subdir",
                hydra_context=context,
            )

        with connected(self._address, self._workers or cores(), prints=True):
            done = dict(outcomes(run, range(len(configurations)), retries=0))
        return [
            _returned(done[index], configuration)
            for index, configuration in enumerate(configurations)
        ]

    def _configuration(self, overrides: list[str], number: int, directory: Path) -> DictConfig:
        configuration = self._context.config_loader.load_sweep_config(self._config, overrides)
        with open_dict(configuration):
            configuration.hydra.job.id = configuration.hydra.job.num = number
            configuration.hydra.sweep.dir = str(directory)  # a worker may stand elsewhere
        return configuration


def _returned(outcome: Any, configuration: DictConfig) -> JobReturn:
    """What a job returned; that it failed, where it could not return anything."""
    if isinstance(outcome, JobReturn):
        return outcome
    overrides = list(configuration.hydra.overrides.task)
    failed = JobReturn(overrides=overrides, status=JobStatus.FAILED)
    failed.return_value = outcome
    return failed
