"""Tests of `calibrate.problem`."""
