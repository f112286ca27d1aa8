"""Limits on the text of a lab sheet, applied before a TOML reader spends time on it.

A reader's time grows as the square of the parts of a key, and with every level of nesting. Here one
look at each word is enough.
"""

import re

from mrjax.core.errors import InputError

MOST_PARTS = 16
"""Most parts of a key, such as the three of `a.b.c`; a sheet has keys of two."""
MOST_DEEP = 16
"""Tables and lists in each other; a sheet has four."""
MOST_KEYS = 20_000
"""Keys, tables and lists; a sheet of a hundred samples has two thousand."""

_WORD = re.compile(
    r'"""(?:\\.|[^\\])*?(?:"{3,5}|\Z)'  # what is never closed is one word to the end
    r"|'''.*?(?:'{3,5}|\Z)"
    r'|(?P<key>"(?:\\.|[^"\\\n])*"?'
    r"|'[^'\n]*'?"
    r"|[\w+-]+)"
    r"|\#[^\n]*|[ \t]+(?P<blank>)|(?P<mark>.)",
    re.DOTALL,
)


def refuse_excess(content: str) -> None:
    """Passes a text that a TOML reader is done with in a moment.

    Raises:
      InputError: keys of many parts, deep nesting, or very many keys: the line and the remedy.
    """
    parts = depth = keys = 0
    joined = False  # whether the last word was a dot, which joins what follows to the key before
    for word in _WORD.finditer(content):
        mark = word["mark"]
        if word["key"] is not None:
            parts = parts + 1 if joined else 1
        elif mark in ("[", "{"):
            depth, keys = depth + 1, keys + 1
        elif mark in ("]", "}"):
            depth = max(0, depth - 1)
        keys += mark == "="
        if word["blank"] is None:
            joined = mark == "."
        if parts > MOST_PARTS or depth > MOST_DEEP or keys > MOST_KEYS:
            line = content.count("\n", 0, word.start()) + 1
            raise InputError(f"line {line}: {_excess(parts, depth)}")


def _excess(parts: int, depth: int) -> str:
    if parts > MOST_PARTS:
        return f"a key has more than {MOST_PARTS} parts; write keys such as [box] size"
    if depth > MOST_DEEP:
        return "has tables in tables without end; write them flat"
    return f"has more than {MOST_KEYS} keys, tables and lists; a sheet needs few"
