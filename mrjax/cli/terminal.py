"""Lines on the terminal, whatever text a user has put into them."""

import sys

import click

from mrjax.core.text import in_terminal


def echo(line: str, err: bool = False) -> None:
    """Prints a line, of any text, on standard output, or on standard error."""
    stream = sys.stderr if err else sys.stdout
    click.echo(in_terminal(line, getattr(stream, "encoding", None)), err=err)
