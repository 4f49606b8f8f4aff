"""The cache of one value."""

import weakref

from peaksim.keep_last import keep_last


class Large:
    """Something that can be watched."""


def test_the_last_value_is_kept_and_gone_before_the_next_is_made() -> None:
    alive: list[int] = []
    made: list[weakref.ref[Large]] = []

    @keep_last
    def make(*_: int) -> Large:
        alive.append(sum(one() is not None for one in made))
        large = Large()
        made.append(weakref.ref(large))
        return large

    assert make(1) is make(1)
    make(2)
    make(1)
    assert alive == [0, 0, 0]
