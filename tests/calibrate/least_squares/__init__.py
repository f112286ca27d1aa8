"""Tests of `calibrate.least_squares`."""
