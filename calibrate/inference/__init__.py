"""Inference from a fit: what the data determine, profiles, posterior samples, forecasts."""
