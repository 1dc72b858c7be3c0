"""What the studies in simulation share: methods, marks, tests, runs that resume, figures and tables."""
