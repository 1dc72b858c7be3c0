"""Multi-Strategy Reward Distillation (MSRD) for ROS 2: teach by hand, record, learn, play."""

__version__ = "0.1.0"
