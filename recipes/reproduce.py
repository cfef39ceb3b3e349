"""The main job: train Proposed, Re-OT and Ja-OT, and set them beside the references.

They are trained twice: by the robust variant of DDPG, and exactly as in the paper.

python recipes/reproduce.py
python recipes/reproduce.py scenario=random_disk training.num_episodes=600
"""

import dataclasses
from dataclasses import dataclass
from pathlib import Path

import torch
from rich.console import Console
from torch import Tensor

from hyuav.configuration import Config, recipe, section
from hyuav.evaluation import EvaluationParameters, evaluate
from hyuav.experiment import (
    LEARNED,
    LEARNED_AS_IN_PAPER,
    draw_figures,
    learned_policies,
    print_results,
    reference_policies,
    select_initial_weights,
    train,
)
from hyuav.learning.algorithms import DDPG
from hyuav.learning.cohort import Learner
from hyuav.learning.training import TrainingParameters
from hyuav.parameters import Parameters, count, parameter, text
from hyuav.runs import RunConfiguration
from hyuav.system import SCHEMES
from hyuav.tracking import LoggerParameters


@dataclass(frozen=True)
class Reproduce(Parameters):
    """How the main job is done."""

    seeds: int = parameter(count(), 1)
    candidates: int = parameter(count(), 5)
    """Of each scheme's initial weights, where it is trained as in the paper."""
    candidate_episodes: int = parameter(count(), 50)
    seed: int = parameter(count(0), 0)
    device: str = parameter(text, "cpu")
    threads: int = parameter(count(), 1)


@recipe(
    "reproduce",
    Reproduce,
    groups={"scenario": "two_clusters", "algorithm": "ddpg_robust"},
    sections={
        "training": TrainingParameters,
        "evaluation": EvaluationParameters,
        "logger": LoggerParameters,
    },
    run_directory="runs/${now:%Y-%m-%d_%H-%M-%S}_reproduce_${hydra.runtime.choices.scenario}",
)
def main(config: Config, directory: Path) -> None:
    """Train the three learned schemes side by side, evaluate them all, draw the figures."""
    options = section(config, Reproduce)
    torch.set_num_threads(options.threads)
    parameters = EvaluationParameters.from_dict(config["evaluation"])
    logger = LoggerParameters.from_dict(config["logger"])
    seeds = range(options.seed, options.seed + options.seeds)
    learners = [Learner(scheme, seed) for scheme in SCHEMES for seed in seeds]
    configuration = RunConfiguration.from_dict({**config, "learners": learners})
    scenario = configuration.scenario
    console = Console()
    references = reference_policies(scenario, parameters.resolution, console)
    as_in_paper = dataclasses.replace(configuration, algorithm_name="ddpg", algorithm=DDPG())
    run, paper_run = (
        train(
            path,
            own,
            logger,
            console,
            device=options.device,
            initial_weights=weights,
            request=config,
        )
        for path, own, weights in (
            (directory, configuration, None),
            (directory / "as_in_paper", as_in_paper, _candidates(as_in_paper, options, console)),
        )
    )
    policies = {
        **learned_policies([run], scenario),
        **learned_policies([paper_run], scenario, LEARNED_AS_IN_PAPER),
        **references,
    }
    evaluation = evaluate(
        scenario, configuration.scenario_name, policies, parameters, options.device
    )
    evaluation.save(run.path)
    trained = [(run, LEARNED), (paper_run, LEARNED_AS_IN_PAPER)]
    draw_figures(run.figures, scenario, evaluation, trained)
    print_results(evaluation, console)
    console.print(f"figures: {run.figures}", soft_wrap=True)


def _candidates(
    configuration: RunConfiguration, options: Reproduce, console: Console
) -> dict[str, Tensor] | None:
    """The weights to begin with as the paper does; None for fresh ones."""
    if options.candidates == 1:
        return None
    weights, earned = select_initial_weights(
        configuration, options.candidates, options.candidate_episodes, device=options.device
    )
    reached = ", ".join(f"{value:.1f}" for value in earned)
    console.print(
        f"as in the paper, initial weights from {options.candidates} candidates per scheme "
        f"after {options.candidate_episodes} episodes: {reached} bps/Hz"
    )
    return weights


if __name__ == "__main__":
    main()
