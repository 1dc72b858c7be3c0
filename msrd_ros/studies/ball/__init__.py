"""How well the ball flies and rebounds as real ones do, and the numbers that make it so."""
