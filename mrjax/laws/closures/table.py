"""The closures by the names that a recipe uses, and the ranges in which they hold."""

import inspect
from collections.abc import Callable

from jax import Array
from jax.tree_util import Partial

from mrjax.core.tracing import value_or_none
from mrjax.laws.closures import (
    carman_kozeny,
    floc_richardson_zaki,
    haberman_sayre,
    rigid_network,
    vesilind,
)
from mrjax.laws.closures.brzinski_durian import brzinski_durian
from mrjax.laws.closures.richardson_zaki import richardson_zaki
from mrjax.laws.closures.son2018 import son2018, son2018_smooth
from mrjax.laws.closures.valid_range import ValidRange

CLOSURES: dict[str, Callable[..., Array]] = {
    "son2018": son2018,
    "son2018-smooth": son2018_smooth,
    "haberman-sayre": haberman_sayre.haberman_sayre,
    "richardson-zaki": richardson_zaki,
    "brzinski-durian": brzinski_durian,
    "floc-richardson-zaki": floc_richardson_zaki.floc_richardson_zaki,
    "vesilind": vesilind.vesilind,
    "rigid-network": rigid_network.rigid_network,
    "carman-kozeny": carman_kozeny.carman_kozeny,
}
"""Closures by the names that a lab sheet uses."""

RANGES: dict[Callable[..., Array], Callable[..., ValidRange]] = {
    haberman_sayre.haberman_sayre: haberman_sayre.valid_range,
    floc_richardson_zaki.floc_richardson_zaki: floc_richardson_zaki.valid_range,
    vesilind.vesilind: vesilind.valid_range,
    rigid_network.rigid_network: rigid_network.valid_range,
    carman_kozeny.carman_kozeny: carman_kozeny.valid_range,
}
"""Functions from the coefficients of a closure to its range; other closures hold up to a bed."""


def coefficients(closure: Callable[..., Array]) -> dict[str, float | None]:
    """Returns the coefficients of a closure with their defaults; None for one without a default."""
    rest = list(inspect.signature(closure).parameters.values())[1:]
    return {one.name: None if one.default is one.empty else one.default for one in rest}


def valid_range(closure: Callable[..., Array] | None) -> ValidRange | None:
    """Returns the range of a closure with coefficients.

    It is None for a closure without a stated range, one with traced coefficients, and another
    function.
    """
    if not callable(closure):
        return None
    if not isinstance(closure, Partial):
        closure = Partial(closure)
    # A function of one's own need not be hashable.
    if not any(closure.func is known for known in RANGES):
        return None
    known = {}
    for name, coefficient in closure.keywords.items():
        value = value_or_none(coefficient)
        if value is None:
            return None
        known[name] = float(value)
    return RANGES[closure.func](**known)
