"""Tests of `mrjax.figures`."""
