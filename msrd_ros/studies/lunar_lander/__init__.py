"""FLAIR's lunar lander (Chen et al., CoRL 2022): ten strategies that somebody else demonstrated."""
