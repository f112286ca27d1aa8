"""Tests of `calibrate.experiment`."""
