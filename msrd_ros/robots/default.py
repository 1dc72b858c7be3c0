"""The arm that is meant where nothing is said; apart, as launch files read it without any library."""

DEFAULT_ROBOT = "sawyer"
"""Also the arm of bags and policies of 0.1.0, which do not name theirs."""
