"""Tests of `calibrate.report`."""
