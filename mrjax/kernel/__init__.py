"""A law summed over pairs of particles as one JAX operation. Imports nothing of mrjax."""
