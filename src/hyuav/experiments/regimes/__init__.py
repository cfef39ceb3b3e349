"""Maps of regimes: which scheme is best, and by how much, over two swept parameters."""
