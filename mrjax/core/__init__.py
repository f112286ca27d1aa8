"""The nouns that every room shares: parameters, box, state, run, errors, units.

Helpers make JAX behave the same for all callers: concrete values of traced arguments, dtypes,
random numbers, interruptions. This room imports no other.
"""
