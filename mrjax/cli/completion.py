"""Completion of the names of sheets in a shell."""

from collections.abc import Callable
from pathlib import Path

import click
from click.shell_completion import CompletionItem


def sheet_names(package: str) -> Callable[..., list[CompletionItem]]:
    """Completes what is bundled in a package or a TOML file here, and other paths where none is.

    Bash completes paths by itself only where it is given nothing else.
    """

    def complete(
        _context: click.Context, _parameter: click.Parameter, begun: str
    ) -> list[CompletionItem]:
        from mrjax.recipe import sheets

        names = [*sorted(sheets.bundled(package)), *sorted(map(str, Path().glob("*.toml")))]
        # One that is no line of text would be another answer to the shell.
        matching = [name for name in names if name.startswith(begun) and name.isprintable()]
        items = [CompletionItem(name) for name in matching]
        return items or [CompletionItem(begun, type="file")]

    return complete
