"""The glossary: each of its words is used where it says."""

import dataclasses
import pkgutil
import re

import pytest

from tests.builders import ROOT

ROWS = re.findall(
    r"^\| ([^|]+) \|[^|]*\|[^|]*\| ([^|]+) \| (`.+`) \|$",
    (ROOT / "docs" / "glossary.md").read_text("utf-8"),
    re.M,
)
TEMPLATES = [
    (ROOT / package / "template.toml").read_text("utf-8")
    for package in ("mrjax/recipe", "calibrate/experiment")
]


def is_key(table: str, key: str) -> bool:
    """True if a table of a commented recipe or experiment has a key."""
    sections = [
        section
        for text in TEMPLATES
        for section in re.split(r"^(?=(?:#\? )?\[)", text, flags=re.M)
        if section.removeprefix("#? ").startswith(table)
    ]
    return any(re.search(rf"^(?:#\? )?{key} = ", section, re.M) for section in sections)


def is_name(name: str) -> bool:
    """True for a module, a class, a function, or a field of a dataclass."""
    try:
        pkgutil.resolve_name(name)
    except (AttributeError, ImportError):
        owner, _, field = name.rpartition(".")
        owner = pkgutil.resolve_name(owner)
        return dataclasses.is_dataclass(owner) and field in owner.__dataclass_fields__
    return True


@pytest.mark.parametrize("word, meaning, places", ROWS, ids=[row[0] for row in ROWS])
def test_a_word_of_the_glossary_is_used_where_it_says(word, meaning, places):
    assert meaning.endswith(".") and word.strip() == word
    for place in re.findall("`(.+?)`", places):
        key = re.fullmatch(r"(\[+\w+\]+) (\w+)", place)
        assert is_key(*key.groups()) if key else is_name(place), place


def test_the_glossary_has_each_word_once():
    words = [row[0] for row in ROWS]
    assert len(words) >= 30 and len(set(words)) == len(words)
