"""What people and programs read of a fit: JSON, sentences, Markdown, one HTML page, figures."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__,
    submodules=("figures", "report"),
    submod_attrs={
        "report": [
            "_with_error",
            "by_chance",
            "forecasts",
            "in_words",
            "line",
            "markdown",
            "summary",
            "write",
        ]
    },
)
