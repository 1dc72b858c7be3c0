"""The paper's studies: their recipes, methods beside each other, and reports."""
