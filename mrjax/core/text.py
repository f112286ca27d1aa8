"""Users' text in other languages, through one door each.

Names, labels and keys may hold anything. Messages, terminals, figures, Markdown, HTML and TOML each
take some characters for their own; a door hands a text over so that it is shown as it is.
"""

import html
import json
import math
import re

LONGEST_MESSAGE = 400
"""Characters of a message."""
LONGEST_LABEL = 32
"""Characters of a name in a figure, which has room for no more."""

_ENDS = 0.3
"""Part of a long message that is kept of its beginning; the remedy is at its end."""
_MARKS = re.compile(r"[\\`*\[\]<>&~$#]|(?<![^\W_])_|_(?![^\W_])")
"""Characters that Markdown reads as its own within a line, except `_` between letters."""
_LINKS = re.compile(r"(https?|ftp)(?=://)|www(?=\.)", re.IGNORECASE)
"""Addresses that some readers of Markdown turn into links."""
_LISTS = re.compile(r"^(\d{0,9})(?=[-+=](?![\d.])|(?<=\d)[.)](?:\s|$))")
"""Text at the beginning of a line that begins a list or underlines a heading."""


def printable(text: str) -> str:
    """The text in one line, with what is not printable as Python escapes it.

    Control characters, line breaks, marks that turn the direction of writing, lone surrogates.
    """
    if text.isprintable():
        return text
    return "".join(
        one if one.isprintable() else one.encode("unicode_escape").decode("ascii") for one in text
    )


def shortened(text: str, most: int, ends: float = 0.6) -> str:
    """The text, or its beginning and its end with dots between them.

    Args:
      text: of any length.
      most: characters.
      ends: part of them that is of its beginning.
    """
    if len(text) <= most:
        return text
    begins = round(ends * (most - 3))
    return f"{text[:begins]}...{text[len(text) - (most - 3 - begins) :]}"


def with_error(value: float, error: float) -> str:
    """Value and error with two digits of the error, such as `61.40 ± 0.77`."""
    if not math.isfinite(error):
        return f"{value:.4g} (error unbounded)"
    if error == 0.0:  # such as the height before anything has settled
        return f"{value:.4g}"
    rounded = float(f"{error:.1e}")  # 0.0996 is 0.10
    digits = max(0, 1 - math.floor(math.log10(rounded)))
    return f"{value:.{digits}f} ± {error:.{digits}f}"


def in_message(text: str) -> str:
    """One printable line of at most `LONGEST_MESSAGE` characters."""
    return shortened(printable(" ".join(text.split())), LONGEST_MESSAGE, _ENDS)


def in_terminal(text: str, encoding: str | None = None) -> str:
    """One line that moves no cursor and changes no colour.

    Args:
      text: of any characters.
      encoding: of the terminal or file; what it has no form for is escaped.
    """
    line = printable(text)
    return line.encode(encoding, "backslashreplace").decode(encoding) if encoding else line


def in_figure(text: str) -> str:
    """A label of matplotlib, which sets what is between dollars as mathematics.

    A legend leaves out what begins with `_`, so a space comes before it.
    """
    label = shortened(printable(text), LONGEST_LABEL).replace("$", r"\$")
    return f" {label}" if label.startswith("_") else label


def in_html(text: str) -> str:
    """Text of an element, or of an attribute between quotation marks."""
    return html.escape(printable(text))


class Markdown(str):
    """Text that is Markdown already: of ours, or through `in_markdown` or `in_code`."""


def in_markdown(text: str) -> Markdown:
    """Text of a paragraph, a heading or the cell of a table."""
    line = _MARKS.sub(r"\\\g<0>", printable(text))
    line = _LISTS.sub(r"\1\\", _LINKS.sub(r"\g<0>\\", line))
    kept = line.strip(" ")
    before, after = len(line) - len(line.lstrip(" ")), len(line) - len(line.rstrip(" "))
    return Markdown("&#32;" * before + kept + "&#32;" * after)


def in_code(text: str) -> Markdown:
    """Text as code, in a paragraph or the cell of a table."""
    line = printable(text)
    fence = "`" * (1 + max(map(len, re.findall("`+", line)), default=0))
    edge = " " if line[:1] + line[-1:] != (line[:1] + line[-1:]).strip("` ") else ""
    return Markdown(f"{fence}{edge}{line}{edge}{fence}")


def in_toml(text: str) -> str:
    """A string of TOML, with its quotation marks."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
