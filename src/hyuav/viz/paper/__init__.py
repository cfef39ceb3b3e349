"""The figures: learning, flights, secrecy sum-rates, energy and offloading, for print."""
