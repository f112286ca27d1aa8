"""Least squares with log-normal priors, over any residuals of positive numbers; no physics."""
