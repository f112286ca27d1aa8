"""Tests: one folder for each room of the packages, and what goes across rooms."""
