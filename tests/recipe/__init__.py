"""Tests of `mrjax.recipe`."""
