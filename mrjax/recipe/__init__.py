"""The lab sheet: reading TOML, its tables, sizes, plausibility, and the `Parameters` of a run.

The bundled sheets are in `bundled`, the commented template is `template.toml`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__,
    submodules=(
        "plausibility",
        "recipe",
        "sheets",
        "sizes",
        "suspension",
        "tables",
        "toml_limits",
    ),
    submod_attrs={"recipe": ["Recipe"]},
)
