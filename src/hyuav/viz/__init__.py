"""What is drawn: tables computed once, rendered for print, for HTML and for the dashboard."""
