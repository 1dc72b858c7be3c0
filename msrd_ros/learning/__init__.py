"""Learning: rewards, policies, TRPO, MSRD and its baselines. Knows nothing of ROS or Bullet."""
