"""Measures speed, beside LIGGGHTS where that is installed, and writes the page.

The page beside this file: `python -m tests.studies.benchmarks.speed --large --whole --page`, on a
machine that does nothing else, two hours. Some of it at a time: `--parts curve --parts ensemble`;
what other parts gave before stays in speed.json.
"""

from pathlib import Path

import click
import jax

from mrjax.io import files

from . import (
    command,
    compilation,
    curve,
    ensemble,
    gradients,
    machine,
    page,
    scaling,
    states,
    throughput,
)

PARTS = ("throughput", "curve", "compilation", "gradients", "scaling", "ensemble", "command")


@click.command(help=__doc__)
@click.option("--out", type=click.Path(path_type=Path), default="speed", show_default=True)
@click.option(
    "--parts", type=click.Choice(PARTS), multiple=True, default=PARTS, help="Left out, all."
)
@click.option("--sizes", type=int, multiple=True, help="Numbers of particles, of the nearest beds.")
@click.option("--repetitions", type=click.IntRange(1), default=3, show_default=True)
@click.option("--large", is_flag=True, help="Scaling to a million particles.")
@click.option("--whole", is_flag=True, help="Gradients of the whole curve.")
@click.option("--page", "keep", is_flag=True, help="Also README.md and speed.json beside the code.")
def main(
    out: Path,
    parts: tuple[str, ...],
    sizes: tuple[int, ...],
    repetitions: int,
    large: bool,
    whole: bool,
    keep: bool,
) -> None:
    jax.config.update("jax_enable_x64", True)
    out = files.result_folder(out.resolve())
    tiles = tuple(states.tiles_of(size) for size in sizes) or states.TILES
    measure = {
        "throughput": lambda: throughput.measured(out, tiles, repetitions),
        "curve": lambda: curve.measured(out, repetitions),
        "compilation": lambda: compilation.measured(out),
        "gradients": lambda: gradients.measured(out, repetitions=repetitions, whole=whole),
        "scaling": lambda: scaling.measured(out, tiles, repetitions, large),
        "ensemble": lambda: ensemble.measured(out, repetitions),
        "command": command.measured,
    }
    for part in parts:
        click.echo(part)
        rows = []
        for row in measure[part]():
            rows.append(row)
            known = page.known(out / page.RESULTS.name)
            results = {**known, part: {"machine": machine.described(), "rows": rows}}
            _write(results, out / page.RESULTS.name, out / "speed.md")
    if keep:
        _write(page.known(out / page.RESULTS.name), page.RESULTS, page.PAGE)


def _write(results: dict, as_json: Path, as_text: Path) -> None:
    files.write_json(as_json, results)
    files.write_text(as_text, page.text(page.known(as_json)))


if __name__ == "__main__":
    main()
