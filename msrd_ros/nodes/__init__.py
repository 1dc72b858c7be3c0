"""Nodes: thin rclpy shells of parameters, topics and timers around the wings."""
