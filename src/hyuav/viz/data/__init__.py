"""The tables that are drawn, each computed once; print, HTML and dashboard only render them."""
