"""`mrjax new`: writes a commented recipe as a template."""

from importlib import resources
from pathlib import Path

import click

from mrjax.cli import templates
from mrjax.cli.exit_status import EXIT_STATUS
from mrjax.cli.terminal import echo


@click.command(
    epilog=EXIT_STATUS,
    help="""Writes a commented recipe to FILE, as a template.

    \b
    Example:
      mrjax new mine.toml
    """,
)
@click.argument("file", type=click.Path(path_type=Path))
def new(file: Path) -> None:
    """Writes a copy of the template."""
    text = resources.files("mrjax.recipe").joinpath("template.toml").read_text("utf-8")
    templates.write_new({file: text})
    echo(f"Change {file}, then: mrjax check {file}")
