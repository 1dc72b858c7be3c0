"""Strategies of unlabelled demonstrations: `discover` finds them, `recheck` holds learning against them."""
