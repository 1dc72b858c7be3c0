"""The learning wing: rewards, policies, TRPO, MSRD, AIRL. Knows neither ROS nor Bullet nor table tennis."""
