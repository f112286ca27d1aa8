"""Tests of `mrjax.laws`."""
