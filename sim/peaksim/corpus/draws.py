"""Random numbers of a corpus: each field of each frame or sequence has its own, derived from the seed.

A number is a hash of what it is for, which makes it the same on every machine and in whichever order numbers
are drawn, and leaves all others as they are when a field is added.
"""

from dataclasses import dataclass
from hashlib import blake2b

from peaksim.corpus.spread import Spread, pick_index

_CORPUS, _SEQUENCE, _FRAME = 1, 2, 3


@dataclass(frozen=True)
class Draws:
    """Numbers by name."""

    keys: tuple[int, ...]
    """What the numbers belong to: a level, the seed, and the numbers of sequence or frame."""

    def share(self, name: str) -> float:
        """Return a uniform number, 0 ≤ share < 1."""
        words = " ".join([*map(str, self.keys), name])
        return (int.from_bytes(blake2b(words.encode(), digest_size=8).digest(), "big") >> 11) * 2.0**-53

    def value(self, name: str, spread: Spread) -> float:
        """Return a number from a spread."""
        return spread.at(self.share(name))

    def pick(self, name: str, words: tuple[str, ...]) -> str:
        """Return one of several words, each as likely."""
        return words[self.index(name, (1.0,) * len(words))]

    def index(self, name: str, weights: tuple[float, ...]) -> int:
        """Return one of the indices of the weights."""
        return pick_index(self.share(name), weights)


def corpus_draws(seed: int) -> Draws:
    """Return the numbers that the whole corpus shares."""
    return Draws((_CORPUS, seed))


def sequence_draws(seed: int, sequence: int) -> Draws:
    """Return the numbers that the frames of a sequence share."""
    return Draws((_SEQUENCE, seed, sequence))


def frame_draws(seed: int, frame: int, attempt: int = 0) -> Draws:
    """Return one frame's numbers; `attempt` counts views that were drawn and did not fit."""
    return Draws((_FRAME, seed, frame, attempt))
