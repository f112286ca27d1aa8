"""Closures: f_w, the factor on Stokes' drag in a crowd, as a function of the volume fraction.

One file holds one closure, with its equation, its range of validity and its source. `table` has
their names in recipes; `mrjax.laws.drag` exports the functions.
"""
