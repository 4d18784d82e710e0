"""A deferred value is made once, when it is asked for, and travels as a value."""

import pickle
from concurrent.futures import ThreadPoolExecutor

import pytest

from pns_common import Mesh, loop, refine
from pns_common.base.deferred import Deferred
from tests.support.meshes import bumpy_sphere


def test_it_is_made_once_whoever_asks():
    made = []
    value = Deferred(lambda: made.append(1) or len(made))
    assert not made
    with ThreadPoolExecutor(4) as pool:
        assert {job.result() for job in [pool.submit(value) for _ in range(40)]} == {1}


def test_what_making_it_raises_is_raised_each_time():
    value = Deferred(lambda: 1 / 0)
    for _ in range(2):
        with pytest.raises(ZeroDivisionError):
            value()


def test_it_travels_as_the_value():
    class Here(list):
        """Cannot be pickled: it is local."""

    local = Here([3])
    assert pickle.loads(pickle.dumps(Deferred(lambda: local[0])))() == 3


def test_a_refinement_travels_with_its_report():
    refined = refine(Mesh(*bumpy_sphere(0)), loop(), 2)
    there = pickle.loads(pickle.dumps(refined))
    assert there.report == refined.report
    assert (there.mesh.vertices == refined.mesh.vertices).all()
