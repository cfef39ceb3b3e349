"""The system as TorchRL and Gymnasium environments."""
