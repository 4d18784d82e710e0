"""What a budget allows, by the mesh's unit of length or each vertex's own."""

import numpy as np

from pns_common.fused.learned.budgets import budgets_per_length


def test_a_budget_is_divided_by_the_unit_of_each_vertex():
    rows = np.array([2, 0])
    assert budgets_per_length(3.0, 2.0, rows).tolist() == [1.5, 1.5]
    assert budgets_per_length(3.0, np.array([1.0, 2, 4]), rows).tolist() == [0.75, 3]
