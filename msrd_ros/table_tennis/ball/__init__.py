"""The ball and the table: flight, rebound, impact times, referee, feeder, camera."""
