"""Several algorithms on the same scenarios, schemes, horizons and seeds, beside the optimum."""
