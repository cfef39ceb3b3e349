"""Where a training reports to: its run directory, a logger and the terminal."""

from hyuav.experiments.tracking.logged_run import Job
from hyuav.experiments.tracking.parameters import (
    EvaluationLoggerParameters,
    LoggerParameters,
    loggers,
)
from hyuav.experiments.tracking.reports import in_group, log_comparison, log_evaluation, part_of
from hyuav.experiments.tracking.session import Session
from hyuav.experiments.tracking.tracker import Tracker, learner_names

__all__ = [
    "EvaluationLoggerParameters",
    "Job",
    "LoggerParameters",
    "Session",
    "Tracker",
    "in_group",
    "learner_names",
    "log_comparison",
    "log_evaluation",
    "loggers",
    "part_of",
]
