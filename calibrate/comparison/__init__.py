"""Nested models of one experiment: which effects do the data ask for?"""
