"""The arm at the table: what it must not hit, how it gets from pose to pose, its driver."""
