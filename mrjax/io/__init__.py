"""Reading and writing of files: runs, states, trajectories for viewers, checkpoints, results.

A file is written whole or not at all, never replaces a user's own file, and is validated when it is
read.
"""
