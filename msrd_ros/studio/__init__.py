"""A page in the browser: watch the arm, feed balls, stop it."""
