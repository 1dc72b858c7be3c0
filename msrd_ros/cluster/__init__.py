"""Where independent pieces of work are done: in this process, in others of this machine, or on Ray."""
