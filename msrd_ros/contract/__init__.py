"""What travels between robot, bags and learners: labels, topics, messages as arrays. Defined once for all."""
