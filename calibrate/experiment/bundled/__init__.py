"""Experiments that come with calibrate: Fang et al. (2005), samples A and B."""
