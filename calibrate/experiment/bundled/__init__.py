"""Bundled experiments: Fang et al. (2005), samples A and B, and a synthetic one."""
