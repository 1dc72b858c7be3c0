"""Strokes as learned and played: policies, player, training, rollouts, rates."""
