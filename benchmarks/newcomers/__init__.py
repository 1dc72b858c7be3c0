"""Parts of the benchmark of new teachers."""
