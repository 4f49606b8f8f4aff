"""Rigid transforms as 4×4 float64 matrices, named `target_from_source`.

World: right-handed, metres, z up. Camera: x right, y down, z forward (OpenCV).
"""

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from peaksim.errors import SceneError, check_choice

Pose = NDArray[np.float64]

_RIGID_TOLERANCE = 1e-6
"""Largest error of RᵀR − I: double precision leaves 10⁻¹⁵, rotations stored in single precision 10⁻⁷."""


def rigid(pose: ArrayLike, name: str = "pose") -> Pose:
    """Return `pose` as a (4, 4) float64 rigid transform.

    Raises
    ------
    SceneError
        If it has another shape, is not finite, or is not rotation + translation.
    """
    try:
        matrix = np.asarray(pose, dtype=np.float64)
    except (TypeError, ValueError):
        raise SceneError(f"{name}: expected a 4×4 matrix, got {pose!r}") from None
    if matrix.shape != (4, 4):
        raise SceneError(f"{name}: expected a 4×4 matrix, got shape {matrix.shape}")
    if not np.isfinite(matrix).all():
        raise SceneError(f"{name}: expected finite numbers, got nan or inf")
    rotation = matrix[:3, :3]
    if fault := _fault(rotation, matrix[3]):
        raise SceneError(f"{name}: expected a rigid transform (rotation + translation), got {fault}")
    return matrix


def _fault(rotation: NDArray[np.float64], last_row: NDArray[np.float64]) -> str | None:
    """Return in words what keeps a transform from being rigid, None if it is."""
    error = float(np.abs(rotation.T @ rotation - np.eye(3)).max())
    if error > _RIGID_TOLERANCE:
        return f"one off by {error:.3g} from orthonormal"
    if np.linalg.det(rotation) < 0:
        return "a mirrored one (determinant −1)"
    return None if np.array_equal(last_row, [0, 0, 0, 1]) else f"a last row of {last_row.tolist()}, not 0 0 0 1"


def compose(rotation: ArrayLike, translation_m: ArrayLike) -> Pose:
    """Return the 4×4 transform of a (3, 3) rotation followed by a (3,) translation in metres."""
    pose = np.eye(4)
    pose[:3, :3] = rotation
    pose[:3, 3] = translation_m
    return pose


def invert(pose: Pose) -> Pose:
    """Return the (4, 4) inverse of a rigid transform, exactly by its transpose; `SceneError` if it is none."""
    pose = rigid(pose)
    rotation_t = pose[:3, :3].T
    return compose(rotation_t, -rotation_t @ pose[:3, 3])


def transform(pose: Pose, points: ArrayLike) -> NDArray[np.float64]:
    """Return (..., 3) points mapped by a (4, 4) transform."""
    return np.asarray(np.asarray(points, dtype=np.float64) @ pose[:3, :3].T + pose[:3, 3])


def look_at(eye_m: ArrayLike, target_m: ArrayLike, up: ArrayLike = (0.0, 0.0, 1.0)) -> Pose:
    """Return `world_from_camera` of a camera at `eye_m` that looks at `target_m` (metres, world).

    `up` is the world direction that points up in the image.

    Raises
    ------
    SceneError
        If eye and target coincide, or the viewing direction is parallel to `up`.
    """
    eye = np.asarray(eye_m, dtype=np.float64)
    forward = np.asarray(target_m, dtype=np.float64) - eye
    distance = float(np.linalg.norm(forward))
    if not distance > 0:
        raise SceneError(f"look_at: expected a target away from the eye, got both at {eye.tolist()}")
    forward /= distance
    right = np.cross(forward, np.asarray(up, dtype=np.float64))
    length = float(np.linalg.norm(right))
    if length < 1e-9:
        raise SceneError("look_at: expected a viewing direction that is not parallel to up")
    right /= length
    return compose(np.stack([right, np.cross(forward, right), forward], axis=1), eye)


def rotation_about(axis: str, angle_deg: float) -> NDArray[np.float64]:
    """Return the (3, 3) right-handed rotation about the axis "x", "y" or "z"."""
    c, s = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    check_choice(axis, "xyz", "axis")
    i = "xyz".index(axis)
    j, k = (i + 1) % 3, (i + 2) % 3
    rotation = np.eye(3)
    rotation[[j, j, k, k], [j, k, j, k]] = [c, -s, s, c]
    return rotation


def pose_distance(a: Pose, b: Pose) -> tuple[float, float]:
    """Return how far pose `b` is from pose `a`: the distance of their origins, metres, and their angle, degrees."""
    b_in_a = invert(a) @ rigid(b)
    angle_deg = np.degrees(scipy.spatial.transform.Rotation.from_matrix(b_in_a[:3, :3]).magnitude())
    return float(np.linalg.norm(b_in_a[:3, 3])), float(angle_deg)


def interpolate(start: Pose, end: Pose, fraction: ArrayLike) -> NDArray[np.float64]:
    """Return the (..., 4, 4) poses at fractions (...), 0…1: slerp in rotation, linear in position."""
    start, end = rigid(start, "start"), rigid(end, "end")
    shares = np.asarray(fraction, dtype=np.float64)[..., None]
    relative = scipy.spatial.transform.Rotation.from_matrix(start[:3, :3].T @ end[:3, :3]).as_rotvec()
    turned = scipy.spatial.transform.Rotation.from_rotvec((shares * relative).reshape(-1, 3)).as_matrix()
    poses = np.zeros((*shares.shape[:-1], 4, 4))
    poses[..., :3, :3] = start[:3, :3] @ turned.reshape(*shares.shape[:-1], 3, 3)
    poses[..., :3, 3] = (1 - shares) * start[:3, 3] + shares * end[:3, 3]
    poses[..., 3, 3] = 1
    return poses
