"""Measures the curves, all or those that are named, and writes the page and its figures."""

import sys

import jax

from tests.studies.compressive_yield import curves

if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    curves.write(sys.argv[1:] or list(curves.CONDITIONS))
