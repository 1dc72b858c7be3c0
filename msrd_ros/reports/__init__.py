"""The HTML page that everything writes, and its figures."""
