"""Options that the ways to run share: one set, in every signature."""

import dataclasses
import inspect
from typing import get_type_hints

import pytest

import mrjax
from mrjax.simulation.options import RunKeywords, RunOptions

WAYS = (mrjax.simulate, mrjax.follow, mrjax.settle)
OPTIONS = {field.name: field for field in dataclasses.fields(RunOptions)}


def test_keywords_are_the_options():
    assert get_type_hints(RunKeywords) == get_type_hints(RunOptions)


@pytest.mark.parametrize("way", WAYS, ids=lambda way: way.__name__)
def test_a_signature_shows_every_option(way):
    shown = inspect.signature(way).parameters
    assert {name: shown[name].default for name in OPTIONS} == {
        name: field.default for name, field in OPTIONS.items()
    }
    assert "options" not in shown


@pytest.mark.parametrize("way", WAYS, ids=lambda way: way.__name__)
def test_an_unknown_option_is_refused(way, case2):
    state = mrjax.place([[5e-6, 5e-6, 5e-6]])
    more = {} if way is mrjax.settle else {"duration": 1.0}
    with pytest.raises(TypeError, match="skim"):
        way(state, case2.parameters(), case2.box, **more, skim=0.1)


def test_every_option_is_documented():
    text = inspect.getdoc(RunOptions)
    assert all(f"\n  {name}: " in text for name in OPTIONS)
