"""Tests of `mrjax.core`."""
