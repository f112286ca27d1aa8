"""The lab sheet: TOML files, their tables, size distributions, assumptions, plausibility checks.

The bundled sheets are in `bundled`; `template.toml` is a commented template.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__,
    submodules=(
        "assumptions",
        "composition",
        "contacts",
        "materials",
        "percentiles",
        "plausibility",
        "recipe",
        "sheets",
        "size_checks",
        "sizes",
        "suspension",
        "tables",
        "toml_limits",
    ),
    submod_attrs={"recipe": ["Recipe"]},
)
