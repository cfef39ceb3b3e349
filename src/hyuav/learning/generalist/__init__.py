"""A policy for every layout, trained once across scenarios."""
