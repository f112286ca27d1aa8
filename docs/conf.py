"""The documentation, built by `python -m sphinx -nW --keep-going docs build/docs`."""

import re

import jax.typing


class ArrayLike:
    """Shown by its name: what it stands for is seven types long."""


class DTypeLike:
    """The same."""


jax.typing.ArrayLike, jax.typing.DTypeLike = ArrayLike, DTypeLike

import mrjax  # noqa: E402 - reads its annotations

project = "mrjax"
author = "The mrjax developers"
copyright = "The mrjax developers"
version = release = mrjax.__version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.mathjax",
    "sphinx.ext.viewcode",
]
html_theme = "furo"
html_title = f"mrjax {version}"
html_static_path = ["_static"]
html_css_files = ["narrow.css"]
html_js_files = ["tables.js"]

myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3

autodoc_member_order = "bysource"
autodoc_default_options = {"members": True, "exclude-members": "model_config"}
autodoc_typehints = "description"
autodoc_typehints_description_target = "documented"
autodoc_typehints_format = "short"
python_use_unqualified_type_names = True
napoleon_numpy_docstring = False
napoleon_use_rtype = False

# Types of other projects, whose inventories a build without a network cannot read, and of the
# kernel, which no caller sees.
nitpick_ignore_regex = [
    ("py:class", r"(jax|jaxlib|numpy|optax|pathlib|collections|enum)\..*"),
    (
        "py:class",
        r"mrjax\.(dem\.(pairs\.Pairs|contact_history\.(Pair|Particle)History|integrator\.(Noted|Extra)"
        r"|forces\.kinematics\.\w+|forces\.properties\.\w+)|core\.units\.Units|laws\.water\.NumberT"
        r"|recipe\.(sheets\.Sheet|suspension\.Suspension))",
    ),
    ("py:class", r"(optional|ellipsis|typing\.\w+|conf\.\w+|ArrayLike|DTypeLike)"),
]

SPAN = re.compile(r"(?<!`)(?<!:)`([^`<>]+)`(?!`)")
NAME = re.compile(r"(mrjax|calibrate)(\.\w+)+")
SECTION = re.compile(r"\w+:$")


def as_restructured_text(_app, what, _name, _object, _options, lines: list[str]) -> None:
    """Docstrings are plain text with code in single backticks.

    Full names become links, other code is set as code, paragraphs that are indented or laid out
    with spaces keep their lines.
    """
    paragraphs = [text.split("\n") for text in "\n".join(lines).split("\n\n")]
    lines[:] = []
    # Napoleon would read "Ids: of a particle" as an attribute of type Ids; not after a comment.
    if what in ("attribute", "data", "property"):
        lines += ["..", ""]
    for paragraph in paragraphs:
        if paragraph[0].strip() == "Example:":
            lines += [*paragraph, ""]
        elif SECTION.match(paragraph[0]) or not _laid_out(paragraph):
            lines += [*map(_marked, paragraph), ""]
        else:
            lines += [".. code-block:: text", "", *(f"   {line}" for line in paragraph), ""]


def _laid_out(paragraph: list[str]) -> bool:
    written = [line for line in paragraph if line]
    return any("   " in line.strip() for line in written) or all(
        line.startswith(" ") for line in written
    )


def _marked(line: str) -> str:
    pieces = SPAN.split(line)
    pieces[::2] = [text.replace("|", r"\|") for text in pieces[::2]]
    pieces[1::2] = [
        f":py:obj:`{text}`" if NAME.fullmatch(text) else f"``{text}``" for text in pieces[1::2]
    ]
    # A unit by itself, such as "s.", would begin an enumeration.
    return re.sub(r"(^ *|: )(\w)\.$", r"\1\\\2.", "".join(pieces))


STUDY = re.compile(r"\]\((?:\.\./)+tests/studies/(?:benchmarks/)?(\w+)/README\.md")


def with_links_of_the_site(_app, _name, source: list[str]) -> None:
    """Pages link to the measurements where these lie in the repository; here they are pages."""
    source[0] = STUDY.sub(r"](/studies/\1.md", source[0])


def with_names_of_types(_app, _what, _name, _object, _options, signature, returned):
    """Shows a default such as `float` by its name."""
    return re.sub(r"<class '(\w+)'>", r"\1", signature or "") or signature, returned


def setup(app) -> None:
    """Called by Sphinx."""
    app.connect("autodoc-process-signature", with_names_of_types)
    app.connect("source-read", with_links_of_the_site)
    app.connect("autodoc-process-docstring", as_restructured_text, priority=400)  # Napoleon: 500
