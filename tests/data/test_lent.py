"""Kernels that borrow named tuples do what the same functions do uncompiled, and keep nothing."""

import gc
import subprocess
import sys
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import pytest
from numba import njit

from jeat_graph.data.lent import lent


@lent
class Inner(NamedTuple):
    x: npt.NDArray[np.float64]
    y: npt.NDArray[np.float64]
    factor: int


@lent
class Outer(NamedTuple):
    inner: Inner
    z: npt.NDArray[np.int32]
    plus: float
    flag: bool


def outer(seed: int) -> Outer:
    rng = np.random.default_rng(seed)
    inner = Inner(rng.integers(-9, 9, 5).astype(float), np.zeros(5), seed + 2)
    return Outer(inner, rng.integers(1, 9, 2).astype(np.int32), 0.5 * seed, bool(seed % 2))


@njit
def weigh(inner, whole):
    total = 0.0
    for i in range(len(inner.x)):
        total += inner.x[i] * inner.factor + whole.z[i % 2]
    return total + whole.plus if whole.flag else total


@njit
def fill(inner, value):
    inner.y[:] = inner.x * value


@njit
def hand_on(whole, n):
    """Tuples in tuples, in variables that live over several blocks, and in none."""
    total, inner = 0.0, whole.inner
    for i in range(n):
        total += weigh(inner, whole) if i % 2 else weigh(whole.inner, whole) - whole.plus
    fill(whole.inner, total)
    return total


@njit
def take_turns(one, other, n):
    """One variable that is now this tuple, now that: of its parts each must stay that of its own."""
    total, now = 0.0, one
    for i in range(n):
        inner, plus = now.inner, now.plus
        now = other if i % 2 else one
        total = total / 2.0 + weigh(inner, now) + plus
        for _ in range(2):
            total += inner.factor
        fill(inner, total)
    return total


@njit
def unpack(whole):
    inner, z, plus, flag = whole
    x, _, factor = inner
    return x[0] * factor + z[1] + plus, flag, len(whole)


@njit
def give_back(whole):
    return whole.inner


@njit
def give_array(whole):
    return whole.inner.x


@njit
def fail(whole):
    if whole.flag:
        raise ValueError("flag")
    return whole.plus


@pytest.mark.parametrize("n", [0, 1, 6])
def test_kernels_do_what_the_functions_do(n):
    for seed in range(4):
        compiled, plain = outer(seed), outer(seed)
        assert hand_on(compiled, n) == hand_on.py_func(plain, n)
        assert compiled.inner.y.tolist() == plain.inner.y.tolist()
        assert unpack(compiled) == unpack.py_func(plain)
        other, plain_other = outer(seed + 7), outer(seed + 7)
        assert take_turns(compiled, other, n) == take_turns.py_func(plain, plain_other, n)
        assert compiled.inner.y.tolist() == plain.inner.y.tolist()
        assert other.inner.y.tolist() == plain_other.inner.y.tolist()


def test_nothing_is_kept():
    whole = outer(3)
    hand_on(whole, 2), fail(whole._replace(flag=False))  # compile
    before = [sys.getrefcount(array) for array in (whole.inner.x, whole.inner.y, whole.z)]
    for _ in range(100):
        hand_on(whole, 2)
        unpack(whole)
        with pytest.raises(ValueError, match="flag"):
            fail(whole)
    gc.collect()
    assert [sys.getrefcount(array) for array in (whole.inner.x, whole.inner.y, whole.z)] == before


def test_an_array_of_it_can_be_returned_and_outlives_it():
    whole = outer(5)
    expected = whole.inner.x.tolist()
    kept = give_array(whole)
    del whole
    gc.collect()
    assert kept.tolist() == expected


def test_a_lent_tuple_cannot_be_returned():
    with pytest.raises(TypeError, match="Inner is lent to kernels: they can't return it"):
        give_back(outer(1))


@njit
def generate(whole):
    for x in whole.inner.x:
        yield x * whole.plus


def test_a_generator_cannot_keep_it():
    """It would outlive the call that the arrays were lent for."""
    with pytest.raises(TypeError, match="Outer is lent to kernels: they can't keep it"):
        list(generate(outer(1)))


@njit
def list_both(whole):
    both = [whole.inner, whole.inner]
    return both[0].x[0]


def test_a_list_cannot_keep_it():
    with pytest.raises(TypeError, match="Inner is lent to kernels: they can't keep it"):
        list_both(outer(1))


@njit(no_cpython_wrapper=True, no_cfunc_wrapper=True)
def choose(one, other, first):
    return one.inner if first else other.inner


@njit
def chosen(one, other, first):
    inner = choose(one, other, first)
    return weigh(inner, one) + weigh(choose(one, other, not first), other)


def test_a_kernel_may_return_it_to_another():
    one, other = outer(1), outer(2)
    for first in (True, False):
        plain = weigh.py_func(one.inner if first else other.inner, one)
        plain += weigh.py_func(other.inner if first else one.inner, other)
        assert chosen(one, other, first) == plain


def test_other_types_of_fields_compile_anew():
    whole = outer(1)
    single = whole._replace(inner=whole.inner._replace(x=whole.inner.x.astype(np.float32)))
    assert hand_on(single, 4) == hand_on.py_func(outer(1), 4)


_CACHED = """
import sys
sys.path.insert(0, sys.argv[1])
import lent_cached
print(lent_cached.total(lent_cached.Pair([2.0, 5.0])), sum(lent_cached.total.stats.cache_hits.values()))
"""
_MODULE = """
from typing import NamedTuple
import numpy as np
from numba import njit
from jeat_graph.data.lent import lent

@lent
class _Pair(NamedTuple):
    x: object
    n: int

def Pair(x):
    return _Pair(np.array(x), 3)

@njit(cache=True)
def part(pair, i):
    return pair.x[i] * pair.n

@njit(cache=True)
def total(pair):
    return part(pair, 0) + part(pair, 1)
"""


def test_machine_code_is_found_again_by_another_process(tmp_path):
    (tmp_path / "lent_cached.py").write_text(_MODULE)

    def run():
        command = [sys.executable, "-c", _CACHED, str(tmp_path)]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()

    assert [run(), run()] == [["21.0", "0"], ["21.0", "1"]]
