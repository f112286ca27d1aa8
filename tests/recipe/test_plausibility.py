"""Sheets at the edge of what can be made: accepted on one side, refused by name on the other."""

import pytest

import mrjax

UM = 1e-6


def boxed(recipe, size, periodic=(False, False, False)):
    return recipe.replace(box={"size": [side * UM for side in size], "periodic": list(periodic)})


@pytest.mark.parametrize("axis", range(3))
def test_a_periodic_side_holds_two_particles(case2, axis):
    """Of 4 um: narrower, one would touch two images of another."""
    for side, accepted in ((8.01, True), (7.99, False)):
        size, periodic = [30.0] * 3, [False] * 3
        size[axis], periodic[axis] = side, True
        if accepted:
            assert boxed(case2, size, periodic).box.periodic[axis]
            continue
        with pytest.raises(mrjax.InputError, match=f"periodic along {'xyz'[axis]} but narrower"):
            boxed(case2, size, periodic)


@pytest.mark.parametrize("axis", range(3))
def test_between_walls_there_is_room_for_a_particle(case2, axis):
    for side, accepted in ((4.01, True), (4.0, False), (3.99, False)):
        size = [30.0] * 3
        size[axis] = side
        if accepted:
            assert boxed(case2, size).box.size[axis] == pytest.approx(side * UM)
            continue
        with pytest.raises(mrjax.InputError, match=f"not larger along {'xyz'[axis]}"):
            boxed(case2, size)


@pytest.mark.parametrize("share, accepted", [(0.639, True), (0.641, False)])
def test_no_denser_than_a_random_close_packing(case2, share, accepted):
    """By the volume of the particles, of which their weight follows."""
    solid, liquid = share * 7470.0, (1.0 - share) * 950.0
    made = {"particle": solid / (solid + liquid), "fluid": liquid / (solid + liquid)}
    if accepted:
        assert case2.replace(composition=made).volume_fraction == pytest.approx(share)
        return
    with pytest.raises(mrjax.InputError, match="denser than random close packing"):
        case2.replace(composition=made)


@pytest.mark.parametrize("difference, accepted", [(5e-10, False), (2e-9, True), (-2e-9, True)])
def test_particles_neither_sink_nor_rise_by_rounding_alone(case2, difference, accepted):
    """A density like that of the fluid, but for its last digits, is none that settles."""
    changes = {
        "particle": {"density": 950.0 * (1.0 + difference)},
        "composition": {"particle": 0.3, "fluid": 0.7},
    }
    if accepted:
        assert case2.replace(**changes).volume_fraction == pytest.approx(0.3)
        return
    with pytest.raises(mrjax.InputError, match="would neither sink nor rise"):
        case2.replace(**changes)
