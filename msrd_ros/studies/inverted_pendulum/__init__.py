"""The inverted pendulum study: environment, demonstrators, methods, evaluation, report."""
