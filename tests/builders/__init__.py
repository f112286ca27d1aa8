"""Shared builders of particles, boxes and recipes, and programs that tests start."""

from pathlib import Path

ROOT = Path(__file__).parents[2]
"""The top of the repository: where `tests` is imported from by a new process."""
