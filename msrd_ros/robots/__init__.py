"""An arm, and what follows from it: kinematics, dynamics, limits, motions. Knows neither ball nor ROS."""
