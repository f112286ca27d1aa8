"""What the command lines share: options, versions, and one clear line for every failure."""

import importlib.metadata
import os
import sys
from collections.abc import Callable

import click
import jax

from mrjax.errors import InputError, SimulationError

UNTRUSTED, WRONG_INPUT, INTERRUPTED = 1, 2, 130
"""Exit statuses beside 0."""

PACKAGES = ("mrjax", "jax", "jaxlib", "jax-md", "optax", "optimistix", "scipy", "numpy")


def out_option(default: str) -> Callable:
    """`--out DIR`."""
    return click.option(
        "--out",
        type=str,
        default=default,
        show_default=True,
        metavar="DIR",
        help="Folder for the results; made if need be.",
    )


seed_option = click.option(
    "--seed",
    type=click.IntRange(0, 2**31 - 1),
    default=0,
    show_default=True,
    help="Of the random start.",
)

dtype_option = click.option(
    "--dtype",
    type=click.Choice(["float64", "float32"]),
    default="float64",
    show_default=True,
    help="Precision of the computation.",
)


def set_precision(dtype: str) -> None:
    """Makes `dtype` JAX's default for the rest of the process."""
    jax.config.update("jax_enable_x64", dtype == "float64")


def versions() -> dict[str, str]:
    """Versions of the packages that made a result."""
    return {name: importlib.metadata.version(name) for name in PACKAGES}


def run(command: click.Command, name: str) -> None:
    """Runs a command and exits: 0 done, 1 not to be trusted, 2 wrong input, 130 interrupted."""
    try:
        sys.exit(command.main(prog_name=name, standalone_mode=False))
    except (InputError, SimulationError, click.ClickException) as error:
        text = error.format_message() if isinstance(error, click.ClickException) else str(error)
        status = UNTRUSTED if isinstance(error, SimulationError) else WRONG_INPUT
    except (KeyboardInterrupt, click.Abort):
        click.echo(f"\n{name}: interrupted; no results were written", err=True)
        sys.stdout.flush()
        sys.stderr.flush()
        # After an interrupted compilation jaxlib 0.10.1 crashes while the interpreter shuts down.
        os._exit(INTERRUPTED)
    click.echo(f"{name}: {' '.join(text.split())}", err=True)
    sys.exit(status)
