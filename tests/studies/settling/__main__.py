"""Measures what is missing for the settling page: `python -m tests.studies.settling`, an hour.

What is in `beds.csv`, `gradients.json` or `kynch.json` is not measured again: take it away to begin
anew.
"""

import jax
from tqdm import tqdm

from mrjax.io import files

from . import beds, gradients, kynch, page


def main() -> None:
    """Runs what is missing, then writes README.md and the figures beside this file."""
    jax.config.update("jax_enable_x64", True)
    for ensemble in tqdm(beds.missing(beds.known(beds.FILE)), desc="ensembles"):
        beds.add(ensemble)
        jax.clear_caches()  # a process may map so many compiled programs, and no more
    for name, part in {"kynch.json": kynch, "gradients.json": gradients}.items():
        file = page.FOLDER / name
        if not file.exists():
            files.write_json(file, part.measured())
    files.write_text(page.FOLDER / "README.md", page.text())
    for name, figure in page.figures().items():
        figure.savefig(page.FOLDER / name, dpi=120)


if __name__ == "__main__":
    main()
