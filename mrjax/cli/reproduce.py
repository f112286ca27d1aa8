"""`mrjax reproduce`: recomputes every number and plot of Son (2018)."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mrjax.cli import environment, options
from mrjax.cli.exit_status import EXIT_STATUS
from mrjax.cli.terminal import echo

if TYPE_CHECKING:
    from mrjax.paper.figures import PaperFigure
    from mrjax.paper.row import Row


@click.command(
    epilog=EXIT_STATUS,
    help="""Recomputes every number and plot of Son (2018).

    Writes reproduce.json and reproduce.md, with the printed and computed numbers of Table 2 and of
    the text. Each number is reproduced, corrected or not reproducible, with the reason. Rows beyond
    the paper have final ratios with attraction and rolling resistance, beside the measured ones.
    Also writes the paper's figures 2 and 4 to 8 from these results. Takes some ten minutes;
    --resume continues a stopped command.

    \b
    Example:
      mrjax reproduce --out results
    """,
)
@options.out_option("reproduce")
@click.option(
    "--ensemble",
    type=click.IntRange(1, 10_000),
    default=3,
    show_default=True,
    help="Random starts for each final ratio, with seeds from --seed on.",
)
@options.pdf_option
@options.resume_option
@options.seed_option
@options.dtype_option
@options.quiet_option
@options.json_option
def reproduce(
    out: str,
    ensemble: int,
    pdf: bool,
    resume: bool,
    seed: int,
    dtype: str,
    quiet: bool,
    as_json: bool,
) -> None:
    """Simulates the three cases of the paper and writes the comparison."""
    environment.start_jax(dtype)
    import mrjax
    from mrjax.cli.resume import checkpointed
    from mrjax.io import files
    from mrjax.io.versions import versions
    from mrjax.paper import beyond, row, runs, table
    from mrjax.paper.figures import paper_figures

    def report(text: str) -> None:
        if not quiet:
            echo(text, err=True)

    folder = files.result_folder(Path(out))
    work = dict(command="reproduce", ensemble=ensemble, seed=seed, dtype=dtype)
    writes = ["reproduce.json", "reproduce.md"]
    with checkpointed(folder, resume, quiet, writes, **work) as checkpoint:
        simulated = runs.simulated(seed, ensemble, report, checkpoint, progress=not quiet)
        report("settling case2 at its viscosity")
        settled = mrjax.sedimentation(
            mrjax.Recipe.load("case2"),
            seed,
            progress=not quiet,
            checkpoint=checkpoint / "settled",
        )
        beds = beyond.settled(seed, ensemble, report, checkpoint / "beyond", progress=not quiet)
        rows = [*table.rows(simulated), *beyond.rows(beds)]
        text = _markdown(rows)
        figures = paper_figures(rows, simulated, settled)
        made_by = {"seed": seed, "dtype": dtype, "versions": versions()}
        _write(folder, rows, text, figures, made_by, pdf=pdf, progress=not quiet)
    if as_json:
        click.echo(files.as_json(row.as_tables(rows), ascii_only=True))
    elif not quiet:
        for line in text.splitlines():
            echo(line)
        echo(f"Results: {folder}")


def _markdown(rows: "list[Row]") -> str:
    """Returns the rows as a Markdown table."""
    from mrjax.io import files

    return files.markdown_table(
        ["case", "quantity", "printed", "computed", "unit", "status", "reason"],
        (
            [
                row.case,
                row.quantity,
                f"{row.printed:g}",
                row.computed_text,
                row.unit,
                row.status,
                row.reason,
            ]
            for row in rows
        ),
    )


def _write(
    folder: Path,
    rows: "list[Row]",
    table: str,
    figures: "list[PaperFigure]",
    made_by: dict[str, Any],
    *,
    pdf: bool,
    progress: bool,
) -> None:
    """Writes the figures, reproduce.json and reproduce.md."""
    from tqdm import tqdm

    from mrjax.io import files
    from mrjax.paper.row import as_tables

    for figure in tqdm(figures, desc="figures", disable=not progress, leave=False):
        files.write_figure(folder, figure.name, figure.figure, made_by, pdf)
    captions = "\n".join(
        f"![Fig. {figure.number}]({figure.name}.png)\n\nFig. {figure.number}. {figure.caption}\n"
        for figure in figures
    )
    files.write_json(folder / "reproduce.json", as_tables(rows))
    files.write_text(
        folder / "reproduce.md", f"# Son (2018), recomputed\n\n{table}\n## Figures\n\n{captions}"
    )
