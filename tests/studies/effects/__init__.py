"""How often a comparison of models finds the effects that are in the data."""
