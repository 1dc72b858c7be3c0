"""One more teacher: a known strategy, something between two of them, or a new one. See `Newcomers`."""
