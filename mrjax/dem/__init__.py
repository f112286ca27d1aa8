"""The discrete element method: neighbour list, pair forces, contact history, integrator, engine.

It works in reduced units, with concrete shapes. `mrjax.simulation` has the functions that run it.
"""
