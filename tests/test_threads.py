"""Work in threads: in the order of the items, in double precision, given up where one fails."""

import threading

import jax
import jax.numpy as jnp
import pytest

from jaxfric.explanation import threads


def test_each_keeps_the_order_and_double_precision():
    with jax.enable_x64(True):
        made = threads.each(lambda item: jnp.asarray(1.0 / item), range(1, 20))
    assert [float(x) for x in made] == [1.0 / item for item in range(1, 20)]
    assert {x.dtype for x in made} == {jnp.dtype("float64")}


def test_several_are_at_it_at_once():
    meeting = threading.Barrier(2, timeout=20)
    assert sorted(threads.each(lambda _: meeting.wait(), range(2))) == [0, 1]


def test_where_one_fails_the_others_are_not_begun():
    begun = []
    fail = threading.Event()

    def work(item):
        begun.append(item)
        if item == 0:
            raise ValueError("the first one")
        fail.wait(20)

    with pytest.raises(ValueError, match="the first one"):
        threads.each(work, range(50))
    fail.set()
    assert len(begun) < 10


def test_blas_keeps_to_one_thread_until_the_last_leaves():
    threadpoolctl = pytest.importorskip("threadpoolctl")

    def counts():
        infos = threadpoolctl.threadpool_info()
        return [info["num_threads"] for info in infos if info["user_api"] == "blas"]

    before = counts()
    with threads.single():
        with pytest.raises(RuntimeError), threads.single():
            raise RuntimeError
        assert counts() == [1] * len(before)
    assert counts() == before
