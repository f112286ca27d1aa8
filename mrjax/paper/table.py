"""Every number of Son (2018), Table 2 and text, recomputed: reproduced, corrected, or neither."""

from mrjax import Recipe
from mrjax.paper import eq_14, table_2, text
from mrjax.paper.case import Case
from mrjax.paper.row import Row
from mrjax.paper.runs import CASES, Simulated


def rows(runs: Simulated) -> list[Row]:
    """The paper's numbers beside those of the runs."""
    cases = {name: Case(name, Recipe.load(name), runs) for name in CASES}
    of_cases = (row for case in cases.values() for row in table_2.rows(case))
    return [*of_cases, *text.rows(cases, runs), *eq_14.rows()]
