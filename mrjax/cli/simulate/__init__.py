"""`mrjax simulate`: the command, what is asked of it, the run, its summary and its files.

Only `command` and `request` are imported before the command begins: the others import JAX.
"""

from mrjax.cli.simulate.command import simulate as simulate
