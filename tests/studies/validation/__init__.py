"""Collisions and impacts against closed forms, published tests and another code."""
