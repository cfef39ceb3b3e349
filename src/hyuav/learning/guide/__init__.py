"""The planner of the robust variants, a plug-in of the training loop."""
