"""Tests of `calibrate.models`."""
