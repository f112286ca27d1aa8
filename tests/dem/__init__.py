"""Tests of `mrjax.dem`."""
