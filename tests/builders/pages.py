"""Pages in Markdown: their blocks of code, and the comments above these that say how to check them.

    <!-- slow -->              runs in the slow set; so do the blocks after it on the page
    <!-- not run: reason -->   is only read: Python is compiled, a shell block is left alone
    <!-- parsed -->            its commands are parsed, not run
    <!-- file: mine.toml -->   is also written to that file, for the blocks below it

A block of `text` directly below another block is the output of that one.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from markdown_it import MarkdownIt
from markdown_it.token import Token

from tests.builders import ROOT

PAGES = [
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    *sorted((ROOT / "docs").rglob("*.md")),
]
REPRODUCTION = (ROOT / "docs" / "explanations" / "reproduction.md").read_text("utf-8")
MARKS = {"slow", "not run", "parsed", "file"}
MARK = re.compile(r"<!--\s*([a-z ]+?)\s*(?::\s*(.*?)\s*)?-->")


@dataclass(frozen=True)
class Block:
    """A fenced block of a page."""

    page: Path
    line: int
    """Number of its opening fence, from 1."""
    language: str
    """The first word after the fence."""
    text: str
    marks: dict[str, str] = field(default_factory=dict)
    """What the comments directly above say: a mark and what follows its colon."""
    output: str | None = None
    """The block of text directly below it."""

    @property
    def place(self) -> str:
        return f"{name(self.page)}:{self.line}"


def name(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


def blocks(page: Path) -> list[Block]:
    """All fenced blocks of a page, in their order."""
    return list(_blocks(page, MarkdownIt().parse(page.read_text("utf-8"))))


def _blocks(page: Path, tokens: list[Token]) -> Iterator[Block]:
    for place, token in enumerate(tokens):
        if token.type == "fence":
            language = token.info.split(maxsplit=1)[0] if token.info.strip() else ""
            marks = _marks(tokens[:place])
            output = _output(tokens[place + 1 :])
            yield Block(page, token.map[0] + 1, language, token.content, marks, output)


def _marks(before: list[Token]) -> dict[str, str]:
    """The comments directly above a block."""
    marks = {}
    while before and before[-1].type == "html_block":
        comment = before.pop().content.strip()
        match = MARK.fullmatch(comment)
        marks |= {match[1]: match[2] or ""} if match else {comment: ""}
    return marks


def _output(after: list[Token]) -> str | None:
    if after and after[0].type == "fence" and after[0].info.strip() == "text":
        return after[0].content
    return None


def reproduced_rows(page: str) -> list[str]:
    """Rows of the table of reproduced numbers on a page."""
    return [line for line in page.splitlines() if line.startswith(("| case", "| Eq"))][1:]
