"""Tests of `mrjax.paper`."""
