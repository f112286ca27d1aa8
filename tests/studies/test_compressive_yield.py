"""The compressive yield stress of particles that attract each other, as it was measured."""

import numpy as np
import pytest

from tests.studies.compressive_yield import curves, page, tubes

MEASURED = curves.curves()


def test_the_page_shows_the_stresses_and_the_laws_that_were_measured():
    written = page.TEXT.read_text("utf-8")
    for table in (page._stresses(MEASURED), page._laws(MEASURED), page._ratios(MEASURED)):
        assert table in written


@pytest.mark.parametrize("name", ["base", "rolling"])
def test_the_law_of_a_column_fits_over_two_decades(name):
    curve = MEASURED[name]
    fit = curves.fit(curve)
    mean = curve.stress.mean(axis=0)[fit.fitted]
    law = np.asarray(fit.compression.solid_stress(curve.volume_fraction[fit.fitted]))
    assert mean[-1] / mean[0] > 100.0
    # The starts vary by some 10 %, four of them by 5 to 20 % from step to step.
    assert np.sqrt(np.mean(np.log(mean / law) ** 2)) < 0.2
    assert np.sqrt(fit.covariance[0, 0]) < 0.02


def test_rolling_resistance_makes_a_network_at_lower_volume_fractions():
    gel = {name: curves.fit(MEASURED[name]) for name in ("base", "rolling")}
    without, with_it = (float(fit.compression.gel_fraction) for fit in gel.values())
    errors = [fit.covariance[0, 0] for fit in gel.values()]
    assert without - with_it > 3.0 * np.sqrt(sum(errors))


def test_the_stress_along_the_axis_of_compression_is_the_larger():
    curve = MEASURED["base"]
    assert (curve.lateral[:, -10:].mean(axis=1) < curve.stress[:, -10:].mean(axis=1)).all()


@pytest.mark.slow
def test_the_page_is_that_of_the_data():
    assert page.text(tubes.settled()) == page.TEXT.read_text("utf-8")


@pytest.mark.slow
def test_a_stronger_network_makes_a_higher_bed():
    heights = [tube.ratio[-1] for tube in tubes.settled()]
    assert heights[0] <= heights[1] < heights[2] < heights[3]
