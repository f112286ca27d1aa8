"""The report of a fit: JSON, sentences, Markdown, one HTML page, figures."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__,
    submodules=("document", "figures", "formatting", "page", "remarks", "tables", "words"),
    submod_attrs={
        "document": ["markdown"],
        "formatting": ["by_chance"],
        "page": ["write", "write_tubes"],
        "tables": ["forecasts", "summary"],
        "words": ["in_words", "line"],
    },
)
