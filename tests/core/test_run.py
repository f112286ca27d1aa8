"""What is read off a run itself: its mudline, whichever way particles move, and its faults."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import mrjax
from mrjax.core.run import Fault, from_bed, reasons
from tests.builders.runs import run_of

BOX = mrjax.Box((10.0, 10.0, 40.0))
HEIGHTS = [[30.0, 20.0], [25.0, 18.0], [15.0, 17.0]]
RADIUS = jnp.array([1.0, 3.0])


def test_the_mudline_is_the_top_of_the_highest_or_the_bottom_of_the_lowest():
    """By surfaces, not by centres: a large particle may reach beyond a higher one."""
    run = run_of(range(3), HEIGHTS, BOX, radius=RADIUS)
    np.testing.assert_array_equal(run.mudline, [31.0, 26.0, 20.0])
    rising = run_of(range(3), HEIGHTS, BOX, radius=RADIUS, rising=jnp.asarray(True))
    np.testing.assert_array_equal(rising.mudline, [17.0, 15.0, 14.0])
    both = jax.tree.map(
        lambda *leaves: jnp.stack(leaves),
        run_of(range(3), HEIGHTS, BOX, radius=RADIUS, rising=jnp.asarray(False)),
        rising,
    )
    np.testing.assert_array_equal(both.mudline, [run.mudline, rising.mudline])
    np.testing.assert_array_equal(
        from_bed(both, both.mudline), [run.mudline, 40.0 - rising.mudline]
    )


def test_a_fault_of_any_of_several_runs_is_told():
    good, bad = (
        run_of([0.0, 1.0], [[5.0], [4.0]], BOX, fault=jnp.asarray(int(fault), jnp.int32))
        for fault in (Fault(0), Fault.ESCAPED | Fault.TOO_DEEP)
    )
    good.check()
    for order in ((good, bad), (bad, good)):
        several = jax.tree.map(lambda *leaves: jnp.stack(leaves), *order)
        with pytest.raises(mrjax.SimulationError) as error:
            several.check()
        said = str(error.value)
        assert "went through a wall" in said and "overlap by more than a quarter" in said
        assert said.endswith("(100 steps of 0.1 s)")


def test_every_fault_has_its_reason():
    for fault in Fault:
        assert reasons(fault) and reasons(fault) in reasons(~Fault(0))
    assert len({reasons(fault) for fault in Fault}) == len(Fault) and reasons(Fault(0)) == ""
