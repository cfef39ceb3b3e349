"""The live dashboard: runs as they train, flights, and scenarios to change and fly at once."""
