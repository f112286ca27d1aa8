"""The nouns that every room shares: parameters, box, state, run, errors, units.

Also what makes JAX behave the same for all callers: concrete values of traced arguments, dtypes,
random numbers, interruptions. Imports no other room.
"""
