"""Son (2018) recomputed: its simulations, every printed number with ours, and its figures."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__,
    submodules=(
        "beyond",
        "case",
        "dry_beds",
        "eq_14",
        "figures",
        "row",
        "runs",
        "table",
        "table_2",
        "text",
    ),
    submod_attrs={
        "dry_beds": ["INFERRED_FRICTION", "dropped"],
        "eq_14": ["HABERMAN_SAYRE_EXACT"],
        "row": ["Row", "as_tables"],
        "runs": ["CASES", "Simulated", "simulated"],
        "table": ["rows"],
    },
)
