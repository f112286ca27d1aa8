"""Processes that compute together: each connected to the first, none left waiting for a dead one.

`meet` brings them together into a `Group`; `timing` says how long each waits.
"""

from mrjax.simulation.partners import timing as timing
from mrjax.simulation.partners.group import Group as Group
from mrjax.simulation.partners.meeting import meet as meet
