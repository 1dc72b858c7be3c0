"""The demo: six strokes taught, recorded, learned and played over topics, and its report."""
