"""What every room needs and none owns: errors, files, the terminal, random numbers."""
