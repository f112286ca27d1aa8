"""`mrjax simulate`: the command, its options, the simulation, the summary and the files.

Only `command` and `request` are imported before the command begins, because the other modules
import JAX.
"""

from mrjax.cli.simulate.command import simulate as simulate
