"""Tests of `mrjax.observables`."""
