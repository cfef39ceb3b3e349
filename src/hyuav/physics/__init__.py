"""The paper's equations as pure functions on batched tensors: no learning, no state."""
