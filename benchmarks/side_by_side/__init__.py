"""Ours beside others': what `make benchmarks` measures, and the one table that it writes."""
