"""Algorithm 1 and its relatives, built from TorchRL parts along an axis of learners."""
