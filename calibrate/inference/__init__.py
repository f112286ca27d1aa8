"""What a fit says beyond its optimum: what the data determine, profiles, samples, forecasts."""
