"""Tests of `mrjax.dem.forces`."""
