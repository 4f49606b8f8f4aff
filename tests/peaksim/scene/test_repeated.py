"""Triangles divided where their image begins anew."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from peaksim.errors import SceneError
from peaksim.scene.repeated import divide_at_repeats


@given(st.integers(0, 10_000))
def test_parts_cover_the_triangles_and_keep_what_they_show(seed: int) -> None:
    rng = np.random.default_rng(seed)
    corners, uv = rng.uniform(-1, 1, (3, 3, 3)), rng.uniform(-1.7, 2.6, (3, 3, 2))
    parts, part_uv, is_repeated = divide_at_repeats(corners, uv, 1000, "m")
    assert is_repeated
    assert part_uv.min() >= 0
    assert part_uv.max() <= 1
    normals, whole = (np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]) for t in (parts, corners))
    assert np.allclose(normals.sum(axis=0), whole.sum(axis=0))  # they face the same way
    assert np.linalg.norm(normals, axis=1).sum() == pytest.approx(np.linalg.norm(whole, axis=1).sum())
    for part, coordinates in zip(parts, part_uv, strict=True):
        middle, shown = part.mean(axis=0), coordinates.mean(axis=0)
        found = []
        for triangle, own in zip(corners, uv, strict=True):
            shares = np.linalg.lstsq(np.vstack([triangle.T, np.ones(3)]), np.append(middle, 1), rcond=None)[0]
            inside = (shares > -1e-9).all() and np.allclose(shares @ triangle, middle, atol=1e-9)
            away = shares @ own - shown
            found.append(inside and np.allclose(away, np.rint(away), atol=1e-6))
        assert any(found)


def test_an_image_that_fits_once_is_not_divided() -> None:
    corners, uv = np.random.default_rng(0).uniform(-1, 1, (1, 3, 3)), np.array([[[3.0, -2], [4, -1], [3, -1]]])
    parts, part_uv, is_repeated = divide_at_repeats(corners, uv, 10, "m")
    assert np.array_equal(parts, corners)
    assert np.array_equal(part_uv, uv - [3, -2])
    assert not is_repeated


@pytest.mark.parametrize(("uv", "message"), [(1e9, "repeated at most 100 times"), (np.nan, "finite"), (99.0, "100")])
def test_too_many_repeats_are_refused(uv: float, message: str) -> None:
    coordinates = np.array([[[0.0, 0], [uv, 0], [0, 1 if uv > 100 else uv]]])
    with pytest.raises(SceneError, match=f"m: expected .*{message}"):
        divide_at_repeats(np.eye(3)[None], coordinates, 100, "m")
