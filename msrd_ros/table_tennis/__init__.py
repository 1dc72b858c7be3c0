"""Table tennis: robot, ball, referee, simulators and teachers. Knows nothing of ROS or learning."""
