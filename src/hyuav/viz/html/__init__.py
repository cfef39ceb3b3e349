"""Self-contained HTML reports of runs and comparisons, and the Plotly figures in them."""
