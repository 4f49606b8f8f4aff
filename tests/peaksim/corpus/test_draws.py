"""Draws: uniform, independent between names, keys and levels, and the same in any order."""

import numpy as np
from peaksim.corpus.draws import Draws, corpus_draws, frame_draws, sequence_draws
from peaksim.corpus.spread import Spread
from scipy.stats import kstest


def test_shares_are_uniform_over_frames_names_and_seeds() -> None:
    over_frames = [frame_draws(0, i).share("a") for i in range(2000)]
    over_names = [frame_draws(0, 0).share(str(i)) for i in range(2000)]
    over_seeds = [sequence_draws(i, 3).share("a") for i in range(2000)]
    for shares in (over_frames, over_names, over_seeds):
        assert kstest(shares, "uniform").pvalue > 0.01
    assert abs(np.corrcoef([over_frames, over_names, over_seeds]) - np.eye(3)).max() < 0.1


def test_a_number_depends_on_its_keys_and_name_alone() -> None:
    draws = frame_draws(3, 7)
    forwards = [draws.share(name) for name in "abc"]
    assert forwards == [frame_draws(3, 7).share(name) for name in "cba"][::-1]
    others = [corpus_draws(3), sequence_draws(3, 7), frame_draws(7, 3), frame_draws(3, 7, 1), Draws((3, 3, 77))]
    assert len({d.share("a") for d in [draws, *others]}) == 6


def test_value_and_index_pick_by_share() -> None:
    draws, spread = frame_draws(1, 2), Spread.model_validate([10, 20])
    assert draws.value("x", spread) == 10 + 10 * draws.share("x")
    assert draws.index("x", (1.0, 1.0)) == int(draws.share("x") >= 0.5)


def test_the_numbers_are_pinned_because_corpora_are_made_again_from_them() -> None:
    assert frame_draws(2009, 12).share("view.roll_deg") == PINNED


PINNED = 0.005729361194722893
