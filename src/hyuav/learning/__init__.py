"""Algorithm 1 and its relatives, built from TorchRL parts along an axis of learners."""

from hyuav._support.loading import load_quietly

load_quietly("torchrl.collectors")
