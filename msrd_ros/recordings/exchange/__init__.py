"""Bags as data sets of LeRobot and Minari, and such data sets as bags."""
