"""Run directories, evaluation, comparison, tracking: what is done with trainings."""
