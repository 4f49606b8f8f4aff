"""Key points as values: shapes, selection, joining, OpenCV."""

import numpy as np
import pytest

from peakmark.errors import InputError
from peakmark.keypoints.keypoints import Keypoints
from tests.samples import assert_equal, some_keypoints


@pytest.mark.parametrize(
    "rows", [slice(1, 4), [3, 0], np.array([True, False, True, False, True]), slice(None, None, -1)]
)
def test_selection_picks_rows_of_every_column(rows: object) -> None:
    keypoints = some_keypoints()
    chosen = keypoints[rows]  # type: ignore[index]
    for name, column in keypoints.columns().items():
        np.testing.assert_array_equal(getattr(chosen, name), column[rows])  # type: ignore[index]


def test_one_index_is_a_single_key_point_and_none_is_empty() -> None:
    keypoints = some_keypoints()
    assert_equal(keypoints[2], keypoints[2:3])
    assert_equal(keypoints[-1], keypoints[4:5])
    assert_equal(keypoints[[]], keypoints[:0])
    with pytest.raises(IndexError):
        keypoints[5]
    assert [len(one) for one in keypoints] == [1] * 5


def test_joining_the_parts_gives_the_whole() -> None:
    keypoints = some_keypoints(7)
    assert_equal(Keypoints.concatenate([keypoints[:3], keypoints[3:3], keypoints[3:]]), keypoints)
    assert len(Keypoints.concatenate([])) == 0
    with pytest.raises(InputError, match="one length"):
        Keypoints.concatenate([keypoints, some_keypoints(2, None)])


def test_empty_has_the_right_shapes() -> None:
    assert Keypoints.empty().xy.shape == (0, 2)
    assert Keypoints.empty().descriptors is None
    assert Keypoints.empty(128).columns()["descriptors"].shape == (0, 128)


@pytest.mark.parametrize(
    ("column", "value", "words"),
    [
        ("xy", np.zeros((5, 3)), ["xy", "(5, 2)", "(5, 3)"]),
        ("angle", np.zeros(4), ["angle", "(5,)", "(4,)"]),
        ("descriptors", np.zeros(5), ["descriptors", "(5, d)", "(5,)"]),
        ("descriptors", np.zeros((4, 64)), ["descriptors", "(5, d)", "(4, 64)"]),
    ],
)
def test_columns_of_other_shapes_are_refused(column: str, value: np.ndarray, words: list[str]) -> None:
    with pytest.raises(InputError) as caught:
        some_keypoints().with_columns(**{column: value})
    assert all(word in str(caught.value) for word in words)


def test_columns_cannot_be_reassigned() -> None:
    with pytest.raises(AttributeError):
        some_keypoints().size = np.zeros(5, np.float32)  # type: ignore[misc]


def test_opencv_and_back() -> None:
    keypoints = some_keypoints()
    points = keypoints.to_opencv()
    assert [point.pt for point in points] == [tuple(xy) for xy in keypoints.xy.tolist()]
    back = Keypoints.from_opencv(points, keypoints.descriptors)
    assert_equal(back, keypoints.with_columns(scale=keypoints.size))


def test_class_ids_that_are_no_laplacian_become_zero() -> None:
    points = some_keypoints(2).to_opencv()
    points[0].class_id = 17
    points[1].class_id = -1
    assert Keypoints.from_opencv(points).laplacian.tolist() == [0, -1]
    assert len(Keypoints.from_opencv([])) == 0
