"""Memory that compiled code and Python share."""

import gc
import weakref

import numpy as np

from template_control.compiled import compiled
from template_control.structured import keep


@compiled
def total(kept):
    first, (second, _) = kept.value
    return first.sum() + second.sum()


@compiled
def double(kept):
    kept.value[0][:] *= 2.0


def test_arrays_live_as_long_as_the_tuple_that_is_kept():
    first = np.arange(4.0)
    kept, there = keep((first, (np.ones(3), None))), weakref.ref(first)
    del first
    gc.collect()
    for _ in range(3):  # a call does not give back what it has not taken
        assert total(kept) == 9.0
    assert there() is not None
    del kept
    gc.collect()
    assert there() is None


def test_compiled_code_writes_the_arrays_themselves():
    first = np.arange(4.0)
    double(keep((first, (np.ones(3), None))))
    np.testing.assert_array_equal(first, 2.0 * np.arange(4.0))
