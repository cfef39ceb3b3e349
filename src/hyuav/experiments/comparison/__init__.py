"""Several algorithms on the same scenarios, mode rules, horizons and seeds, beside the optimum."""
