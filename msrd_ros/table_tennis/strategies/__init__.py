"""What is known of the task's strategies: a table in a file, and the six of the paper."""
