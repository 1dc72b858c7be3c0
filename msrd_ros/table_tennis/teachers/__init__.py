"""Synthetic teachers: their plans, styles, errors and the study in which they show strokes."""
