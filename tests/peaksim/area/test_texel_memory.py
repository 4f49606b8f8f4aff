"""Memory that one table leaves to the next, and never while anything refers to it."""

import gc

from peaksim.area.texel_memory import empty_texels


def address(texels: object) -> int:
    return texels.__array_interface__["data"][0]  # type: ignore[attr-defined]


def test_memory_is_used_again_when_nothing_refers_to_it() -> None:
    first = empty_texels(1000)
    where = address(first)
    part = first[10:20].reshape(2, 5)
    del first
    gc.collect()
    second = empty_texels(1000)
    assert address(second) != where  # a part of the first one is still there
    del part
    gc.collect()
    assert address(empty_texels(900)) == where


def test_memory_that_is_too_small_or_far_too_large_is_not_used() -> None:
    where = address(empty_texels(1000))
    assert address(empty_texels(1001)) != where
    large = empty_texels(100_000)
    where = address(large)
    del large
    small = empty_texels(100)
    assert address(small) != where
    assert small.shape == (100,)
