"""Particles for a number of steps: neighbours, contacts and their history, integrator, engine.

Works in reduced units on concrete shapes. Ways to run it are in `mrjax.simulation`.
"""
