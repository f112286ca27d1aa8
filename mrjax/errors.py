"""The two ways mrjax says no: the input is wrong, or the result cannot be trusted."""


class InputError(ValueError):
    """What was given cannot be used; the message names the value, the fault and the remedy."""


class SimulationError(RuntimeError):
    """A run ended with a result that must not be used; the message says why and what to change."""
