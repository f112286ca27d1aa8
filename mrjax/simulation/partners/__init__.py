"""Processes that compute together: each is connected to process 0, and none waits for a dead one.

`meet` connects them into a `Group`; `timing` has the times that each waits.
"""

from mrjax.simulation.partners import timing as timing
from mrjax.simulation.partners.group import Group as Group
from mrjax.simulation.partners.meeting import meet as meet
