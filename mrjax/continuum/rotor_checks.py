"""Checks of a column in a rotor."""

import jax.numpy as jnp
import numpy as np
from jax import Array

from mrjax.continuum import kynch
from mrjax.continuum.case import Case
from mrjax.continuum.rotor import LEAST_RATIO, SHAPES, Rotor
from mrjax.core import checks
from mrjax.core.errors import InputError, shown
from mrjax.core.tracing import drop_tracers, evaluated_or_none, value_or_none
from mrjax.laws import particle, yield_stress

SAME = 1e-6
"""Relative difference of two heights that are the same."""


def refuse(case: Case) -> None:
    """Refuses a column that is none in a rotor; traced values pass unchecked.

    Raises:
      InputError: there is such an argument; the message names the first.
    """
    rotor = case.rotor
    if rotor is None:
        return
    checks.require_class(Rotor, rotor=rotor)
    if rotor.shape not in SHAPES:
        raise InputError(
            f"rotor.shape = {shown(rotor.shape)}: must be one of {', '.join(sorted(SHAPES))}"
        )
    for word, value in (("tilt", case.tilt), ("compression", case.compression)):
        if value is not None:
            raise InputError(f"rotor: a column in a rotor has no {word}; leave one of them out")
    if not yield_stress.is_newtonian(case.parameters):
        raise InputError(
            "rotor: a column in a rotor has a Newtonian carrier; leave out the rotor, or the yield "
            "stress and the flow index"
        )
    _refuse_numbers(rotor)
    _refuse_height(case, rotor)
    if rises(case):
        raise InputError(
            "rotor: particles lighter than the fluid move towards the axis of a rotor, which is "
            "not computed; give heavier particles"
        )
    _refuse_thin(case)


def possible(case: Case) -> Array:
    """True, (), if `refuse` would accept the numbers of a rotor; traceable."""
    rotor = case.rotor
    if rotor is None:
        return jnp.asarray(True)
    ratio = jnp.asarray(rotor.top_radius / rotor.floor_radius)
    same = jnp.abs(rotor.height / case.height - 1.0) <= SAME
    sinks = ~particle.rises(case.parameters.replace(gravity=1.0))
    return (jnp.asarray(rotor.speed) > 0.0) & (ratio >= LEAST_RATIO) & (ratio < 1.0) & same & sinks


def rises(case: Case) -> bool:
    """True if particles are known to be lighter than the fluid."""
    known = value_or_none(particle.rises(case.parameters.replace(gravity=1.0)))
    return known is not None and bool(known)


def _refuse_numbers(rotor: Rotor) -> None:
    for name, unit in (("speed", "rpm"), ("top_radius", "m"), ("floor_radius", "m")):
        value = getattr(rotor, name)
        try:
            number = checks.numeric(value)
        except ValueError:
            number = np.zeros(2)
        if number is None:
            continue
        if number.ndim or not number > 0.0 or not np.isfinite(number):
            raise InputError(f"rotor.{name} = {shown(value)}: give one number above 0, in {unit}")
    top, floor = (value_or_none(value) for value in (rotor.top_radius, rotor.floor_radius))
    if top is not None and floor is not None and not LEAST_RATIO * floor <= top < floor:
        raise InputError(
            f"rotor.top_radius = {float(top):g}: must be below floor_radius, {float(floor):g}, and "
            f"at least {LEAST_RATIO:g} of it, in m from the axis"
        )


def _refuse_height(case: Case, rotor: Rotor) -> None:
    height, between = (value_or_none(value) for value in (case.height, rotor.height))
    if height is None or between is None or np.ndim(height):
        return
    if not abs(between - height) <= SAME * between:
        raise InputError(
            f"height = {float(height):g}: must be that between the radii of the rotor, "
            f"{float(between):g}, in m"
        )


def _refuse_thin(case: Case) -> None:
    """Refuses a closure that does not hold where the suspension has become as thin as it may."""

    def thinnest(case: Case) -> Array:
        assert case.rotor is not None
        fraction = jnp.asarray(case.volume_fraction) * case.rotor.volume_to_top
        return jnp.stack([fraction, kynch.velocity(case.parameters, case.hindrance, fraction)])

    evaluated = evaluated_or_none(thinnest, drop_tracers(case))
    if evaluated is None:
        return
    fraction, velocity = (float(value) for value in evaluated)
    if not np.isfinite(velocity):
        raise InputError(
            f"hindrance: in this rotor the suspension thins down to a volume fraction of "
            f"{fraction:.3g}, where the closure does not hold; give another closure"
        )
