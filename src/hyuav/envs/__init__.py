"""The system as TorchRL and Gymnasium environments."""

from hyuav._support.loading import load_quietly

load_quietly("torchrl.envs")
