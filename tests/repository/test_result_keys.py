"""The page of result files lists the keys that are written: those of a fit, held here.

`tests/cli/test_commands.py` holds those of runs, and tests of other kinds of readings call
`undocumented` on their own `fit.json`.
"""

import calibrate
from mrjax import Recipe
from tests.builders.result_keys import documented, undocumented


def test_the_keys_of_a_fit_are_those_of_the_page():
    calibration = calibrate.run(
        "fang2005", model="closed-form", predict=Recipe.load("case2"), like="A"
    )
    fit = calibration.tables()
    assert undocumented(fit) == set()
    assert documented("fit.json") - set(fit) == {"left_out"}  # only where it is asked for
    assert set(fit["parameters"]["f_w"]) == documented("Parameters")
    assert set(fit["determined_combinations"][0]) == documented("Combinations")
    assert set(fit["optima"][0]) == documented("Optima")
    assert set(fit["validity"]["A"]["Reynolds"]) == {"value", "holds"}
    assert "difference_over_both_errors" in fit["new"][0]
