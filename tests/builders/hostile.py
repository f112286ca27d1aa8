"""Names that mean something to a language into which they are put."""

PRINTABLE = {
    # HTML
    "a script": "<script>alert(1)</script>",
    "a picture": "<img src=x onerror=alert(1)>",
    "the end of a title": "</title><script>alert(2)</script>",
    "the end of a cell": "</td></tr></table><iframe src=//x>",
    "a comment": "<!-- never closed",
    "marked text": "<![CDATA[ x ]]>",
    "an instruction": "<?php x ?>",
    "a style": "</style><style>*{display:none}",
    "a block": "<div>",
    "entities": "&lt;script&gt; &amp; &#60;b&#62; &copy",
    "quotation marks": '" onmouseover="alert(1)" \'',
    "the source of a figure": 'src="residuals.png"',
    # Markdown
    "a table": "a|b`c`|d",
    "an escaped bar": "a\\|b",
    "a link": "[click](javascript:alert(1))",
    "an address": "<http://example.org> http://example.org www.example.org",
    "a picture of Markdown": "![x](http://example.org/x.png)",
    "a reference": "[x][y] [^1]: [x]: http://example.org",
    "emphasis": "*a* **b** _c_ __d__ ~~e~~",
    "a heading": "# a ##",
    "a list": "- a",
    "a numbered list": "1. a",
    "a rule": "---",
    "fences": "``` a ~~~",
    "a backtick": "`",
    "a quotation": "> a",
    "spaces": "  two  spaces  ",
    # TeX
    "broken mathematics": "$\\frac$",
    "a brace": "$x^{$",
    "one dollar": "$x",
    "two dollars": "A $5 and $6",
    "an escaped dollar": "\\$x$",
    "a command": "\\alpha $\\badcmd{x}$ \\\\",
    "marks of TeX": "a_b {c} ^d %e #f ~g &h",
    "an underscore": "_nolegend_",
    # Files and tables
    "a way up": "../../x",
    "a device of Windows": "CON",
    "an option": "--out",
    "a formula": "=cmd|' /C calc'!A0",
    "dots": "...",
    # Letters
    "combining marks": "e\u0301" + "\u0336" * 20,
    "other scripts": "試料 образец عينة",
    "emoji": "\U0001f600\U0001f9ea",
    "as long as may be": "x" * 200,
}
"""What a sheet may name a sample."""
UNPRINTABLE = {
    "colours": "\x1b[31mred\x1b[0m",
    "a title of the window": "\x1b]0;mine\x07",
    "a bell": "\x07",
    "backspaces": "good\x08\x08\x08\x08evil",
    "a carriage return": "good\revil",
    "a line of its own": "a\nmrjax: all fine",
    "NUL": "a\x00b",
    "delete": "a\x7fb",
    "C1": "\x9b31m",
    "right to left": "\u202egnp.exe",
    "isolates": "\u2067a\u2069",
    "a line separator": "a\u2028b",
    "no width": "a\u200bb",
}
"""What it may not."""
SURROGATE = {"bytes that are no text": "\udcff\udcfe"}
"""Of a file name; TOML has none."""
NAMES = {**PRINTABLE, **UNPRINTABLE, **SURROGATE}
