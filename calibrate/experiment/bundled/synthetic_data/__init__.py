"""Recipes and curves of the experiment `synthetic`, which no laboratory measured."""
