"""Tests of `calibrate.inference`."""
