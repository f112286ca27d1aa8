"""Tests of `mrjax.simulation`."""
