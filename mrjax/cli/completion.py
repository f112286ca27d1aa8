"""Shell completion of the names of sheets."""

from collections.abc import Callable
from pathlib import Path

import click
from click.shell_completion import CompletionItem


def sheet_names(package: str) -> Callable[..., list[CompletionItem]]:
    """Returns a completion function for sheets bundled in a package and TOML files.

    If no name matches, the shell completes other paths; Bash does so only without other answers.
    """

    def complete(
        _context: click.Context, _parameter: click.Parameter, prefix: str
    ) -> list[CompletionItem]:
        from mrjax.recipe import sheets

        names = [*sorted(sheets.bundled(package)), *sorted(map(str, Path().glob("*.toml")))]
        # The shell reads one answer a line: a name with a line break would be two.
        matching = [name for name in names if name.startswith(prefix) and name.isprintable()]
        items = [CompletionItem(name) for name in matching]
        return items or [CompletionItem(prefix, type="file")]

    return complete
