"""Table tennis: ball, arm at the table, simulation, teachers, strokes. Knows nothing of ROS."""
