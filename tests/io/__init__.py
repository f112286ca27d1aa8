"""Tests of `mrjax.io`."""
