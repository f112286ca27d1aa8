"""Files: written whole or not at all, read without belief, never in place of a user's own.

Runs and states in `.npz`, trajectories for viewers, checkpoints, and lists of results.
"""
