"""Every number of Son (2018), in Table 2 and in the text, recomputed with its status."""

from mrjax import Recipe
from mrjax.paper import eq_14, table_2, text
from mrjax.paper.case import Case
from mrjax.paper.row import Row
from mrjax.paper.runs import CASES, Simulated


def rows(runs: Simulated) -> list[Row]:
    """Returns the rows of all printed numbers with those of the simulations."""
    cases = {name: Case(name, Recipe.load(name), runs) for name in CASES}
    case_rows = (row for case in cases.values() for row in table_2.rows(case))
    return [*case_rows, *text.rows(cases, runs), *eq_14.rows()]
