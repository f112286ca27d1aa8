"""Observables of a run: velocities, heights by several definitions, volume fractions, fronts.

Those of packings read a contact network: stress, coordination, clusters, contacts by direction.
"""
