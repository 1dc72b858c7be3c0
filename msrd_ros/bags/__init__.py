"""Bags: demonstrations as rosbag2 directories with MCAP storage. Knows nothing of torch or Bullet."""
