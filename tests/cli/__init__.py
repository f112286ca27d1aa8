"""Tests of `mrjax.cli`."""
