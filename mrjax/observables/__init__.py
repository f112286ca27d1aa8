"""Observables of a run: velocities, heights by several definitions, volume fractions, fronts."""
