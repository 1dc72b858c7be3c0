"""What a reward is for: strokes that were taught on one arm, learned by another."""
