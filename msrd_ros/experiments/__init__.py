"""Experiments: the recipe of each study, and the reports they write."""
