"""Tests of `mrjax.kernel`."""
