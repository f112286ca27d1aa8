"""Times that processes wait for each other, s."""

PATIENCE = 300.0
"""Longest wait until all processes are there."""
SILENCE = 60.0
"""Time after which a process that sent nothing counts as dead."""
BEAT = 10.0
"""Time between signs of life."""
GRACE = 10.0
"""Time in which a process that has lost another ends by itself."""
