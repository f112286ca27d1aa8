"""Escaping of users' text for messages, terminals, figures, Markdown, HTML and TOML.

Names, labels and keys may hold any characters, and each of these formats gives some characters a
meaning of its own. One function for each format escapes a text so that it is shown as it is.
"""

import html
import json
import math
import re

LONGEST_MESSAGE = 400
"""Largest number of characters of a message."""
LONGEST_LABEL = 32
"""Largest number of characters of a name in a figure."""

_HEAD = 0.3
"""Share of the characters of a shortened message that come from its beginning; the remedy is at the
end."""
_MARKS = re.compile(r"[\\`*\[\]<>&~$#]|(?<![^\W_])_|_(?![^\W_])")
"""Characters with a meaning in Markdown within a line, except `_` between letters."""
_LINKS = re.compile(r"(https?|ftp)(?=://)|www(?=\.)", re.IGNORECASE)
"""Addresses that some Markdown renderers turn into links."""
_LISTS = re.compile(r"^(\d{0,9})(?=[-+=](?![\d.])|(?<=\d)[.)](?:\s|$))")
"""Beginnings of lines that Markdown takes for a list item or for the underline of a heading."""


def printable(text: str) -> str:
    """Returns the text in one line, with characters that are not printable escaped as in Python.

    Escaped are control characters, line breaks, marks that change the direction of writing, and
    lone surrogates.
    """
    if text.isprintable():
        return text
    return "".join(
        character if character.isprintable() else character.encode("unicode_escape").decode("ascii")
        for character in text
    )


def shortened(text: str, most: int, head: float = 0.6) -> str:
    """Returns the text, or its beginning and its end with dots between them.

    Args:
      text: text of any length.
      most: largest number of characters of the result.
      head: share of these characters that come from the beginning of the text.
    """
    if len(text) <= most:
        return text
    cut = round(head * (most - 3))
    return f"{text[:cut]}...{text[len(text) - (most - 3 - cut) :]}"


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
    """Returns the text as one printable line of at most `LONGEST_MESSAGE` characters."""
    return shortened(printable(" ".join(text.split())), LONGEST_MESSAGE, _HEAD)


def in_terminal(text: str, encoding: str | None = None) -> str:
    """Returns the text as one line that moves no cursor and changes no colour.

    Args:
      text: text with any characters.
      encoding: encoding of the terminal or file; characters that it lacks are escaped.
    """
    line = printable(text)
    return line.encode(encoding, "backslashreplace").decode(encoding) if encoding else line


def in_figure(text: str) -> str:
    """Returns the text as a label for matplotlib, which typesets text between dollars as formulas.

    A legend leaves out labels that begin with `_`; they get a space in front.
    """
    label = shortened(printable(text), LONGEST_LABEL).replace("$", r"\$")
    return f" {label}" if label.startswith("_") else label


def in_html(text: str) -> str:
    """Returns the text for an HTML element, or for an attribute between quotation marks."""
    return html.escape(printable(text))


class Markdown(str):
    """Text that is Markdown already, and is not escaped again."""


def in_markdown(text: str) -> Markdown:
    """Escapes text for a paragraph, a heading or the cell of a table."""
    line = _MARKS.sub(r"\\\g<0>", printable(text))
    line = _LISTS.sub(r"\1\\", _LINKS.sub(r"\g<0>\\", line))
    before, after = len(line) - len(line.lstrip(" ")), len(line) - len(line.rstrip(" "))
    return Markdown("&#32;" * before + line.strip(" ") + "&#32;" * after)


def in_code(text: str) -> Markdown:
    """Formats text as code, for a paragraph or the cell of a table."""
    line = printable(text)
    fence = "`" * (1 + max(map(len, re.findall("`+", line)), default=0))
    edge = " " if line[:1] + line[-1:] != (line[:1] + line[-1:]).strip("` ") else ""
    return Markdown(f"{fence}{edge}{line}{edge}{fence}")


def in_toml(text: str) -> str:
    """Returns the text as a TOML string, with its quotation marks."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
