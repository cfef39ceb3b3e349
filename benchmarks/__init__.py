"""How fast this project is beside other libraries that do identical work."""
