"""The tables that are drawn, each computed once."""
