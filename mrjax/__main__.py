"""The command `mrjax`, which simulates a recipe or recomputes the paper."""

import click

from mrjax.cli import exit_status
from mrjax.cli.check import check
from mrjax.cli.column import column
from mrjax.cli.new import new
from mrjax.cli.reproduce import reproduce
from mrjax.cli.simulate import simulate


@click.group(no_args_is_help=False, epilog=exit_status.EXIT_STATUS)
@click.version_option(package_name="mrjax")
def cli() -> None:
    """Settling of magnetorheological fluids by a differentiable discrete element method."""


for command in (simulate, new, check, column, reproduce):
    cli.add_command(command)


def main() -> None:
    """Runs the command line."""
    exit_status.run(cli, "mrjax")


if __name__ == "__main__":
    main()
