"""Limits on the text of a lab sheet, checked before the TOML parser reads it.

The time of a parser grows as the square of the number of parts of a key, and with every level of
nesting. These checks take linear time.
"""

import re

from mrjax.core.errors import InputError

MOST_PARTS = 16
"""Largest number of parts of a key, such as the three of `a.b.c`; keys of a sheet have two."""
MOST_DEEP = 16
"""Deepest nesting of tables and lists; a sheet has four levels."""
MOST_KEYS = 20_000
"""Largest number of keys, tables and lists; a sheet with a hundred samples has two thousand."""

_WORD = re.compile(
    r'"""(?:\\.|[^\\])*?(?:"{3,5}|\Z)'  # a string that is never closed is one word to the end
    r"|'''.*?(?:'{3,5}|\Z)"
    r'|(?P<key>"(?:\\.|[^"\\\n])*"?'
    r"|'[^'\n]*'?"
    r"|[\w+-]+)"
    r"|\#[^\n]*|[ \t]+(?P<blank>)|(?P<mark>.)",
    re.DOTALL,
)


def refuse_excess(content: str) -> None:
    """Refuses a text that would take a TOML parser long.

    Raises:
      InputError: a key has too many parts, tables are nested too deep, or there are too many keys.
    """
    parts = depth = keys = 0
    joined = False  # True after a dot, which joins the next word to the key
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
        return f"tables are nested more than {MOST_DEEP} deep; write them flat"
    return f"there are more than {MOST_KEYS} keys, tables and lists; a sheet needs few"
