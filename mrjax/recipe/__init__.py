"""The lab sheet: reading TOML, its tables, sizes, what is assumed, plausibility, `Parameters`.

The bundled sheets are in `bundled`, the commented template is `template.toml`.
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
