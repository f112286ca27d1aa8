"""Beds, curves and gradients of settling against LIGGGHTS and theory."""
