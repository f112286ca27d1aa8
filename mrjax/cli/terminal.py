"""Printing of lines on the terminal, with any characters."""

import sys

import click

from mrjax.core.text import in_terminal


def echo(line: str, err: bool = False) -> None:
    """Prints a line on standard output or standard error; control characters are escaped."""
    stream = sys.stderr if err else sys.stdout
    click.echo(in_terminal(line, getattr(stream, "encoding", None)), err=err)
