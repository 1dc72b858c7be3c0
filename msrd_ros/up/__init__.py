"""One command that starts everything."""
