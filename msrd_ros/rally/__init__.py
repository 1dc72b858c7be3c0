"""Two arms that play each other: rallies in process, and what is reported of them."""
