"""Where a training reports to: its run directory, Weights & Biases and the terminal."""

from hyuav.experiments.tracking.parameters import EvaluationLoggerParameters, LoggerParameters
from hyuav.experiments.tracking.reports import in_group, log_comparison, log_evaluation, part_of
from hyuav.experiments.tracking.session import Session
from hyuav.experiments.tracking.tracker import Tracker, learner_names

__all__ = [
    "EvaluationLoggerParameters",
    "LoggerParameters",
    "Session",
    "Tracker",
    "in_group",
    "learner_names",
    "log_comparison",
    "log_evaluation",
    "part_of",
]
