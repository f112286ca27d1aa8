"""Measurements: their files, samples, plausibility, and the quantities that are fitted to them.

Files of readings are read in `readings`. The bundled experiments are in `bundled`, the commented
template is `template.toml`.
"""
