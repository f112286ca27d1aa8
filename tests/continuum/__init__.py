"""Tests of `mrjax.continuum`."""
