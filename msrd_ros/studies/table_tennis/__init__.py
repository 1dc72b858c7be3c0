"""The table tennis study: six strokes from recordings to rates, rewards and a report."""
