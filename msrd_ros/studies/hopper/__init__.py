"""The Hopper study: two gaits, one goal."""
