"""Recipes that come with mrjax: the three cases of Son (2018), Table 2."""
