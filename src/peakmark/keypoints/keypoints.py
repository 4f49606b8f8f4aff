"""Key points: what every detector of this package returns.

Pixel centres are at integers, x to the right and y down (CONVENTIONS.md). The columns and their meaning follow
OpenCV's `cv2.KeyPoint`; `scale` adds the size before OpenCV's rounding to an integer.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from peakmark.errors import InputError
from peakmark.keypoints.files import read_columns, write_columns

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

_COLUMN_DTYPES: "dict[str, type[np.generic]]" = {
    "xy": np.float32,
    "size": np.float32,
    "angle": np.float32,
    "response": np.float32,
    "octave": np.int32,
    "laplacian": np.int8,
    "scale": np.float32,
    "descriptors": np.float32,
}


@dataclass(frozen=True, eq=False)
class Keypoints:
    """Key points of one image as columns of equal length n, in the detector's order (strongest first).

    Anything array-like is accepted and kept as an array of the stated dtype.

    Raises
    ------
    InputError
        If a column has another length or shape than stated.
    """

    xy: NDArray[np.float32]
    """(n, 2) position, px."""
    size: NDArray[np.float32]
    """(n,) diameter of the meaningful neighbourhood, px; SURF's is its filter side, rounded as OpenCV does."""
    angle: NDArray[np.float32]
    """(n,) orientation, degrees in 0…360, from +x towards +y; −1 where none was asked for."""
    response: NDArray[np.float32]
    """(n,) strength: SURF's determinant of the Hessian, SIFT's |DoG|."""
    octave: NDArray[np.int32]
    """(n,) octave, 0 is the finest; what OpenCV's detector stored for its own."""
    laplacian: NDArray[np.int8]
    """(n,) OpenCV's class_id: +1 for a dark centre, −1 for a light one, 0 for neither or unknown."""
    scale: NDArray[np.float32]
    """(n,) the size before rounding, px."""
    descriptors: NDArray[np.float32] | None = None
    """(n, d) descriptors, None where none were asked for."""

    def __post_init__(self) -> None:
        count = len(np.atleast_1d(self.size))
        for name, dtype in _COLUMN_DTYPES.items():
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, _column(name, value, dtype, count))

    def __len__(self) -> int:
        return len(self.size)

    def __getitem__(self, rows: int | slice | ArrayLike) -> Self:
        """Select rows by index, slice, index array or boolean mask; one index gives a `Keypoints` of length 1."""
        chosen: Any = rows if isinstance(rows, slice) else np.atleast_1d(np.asarray(rows))
        if not isinstance(chosen, slice) and chosen.size == 0:
            chosen = chosen.astype(np.intp)
        return type(self)(**{name: column[chosen] for name, column in self.columns().items()})

    def __iter__(self) -> "Iterator[Self]":
        return (self[index] for index in range(len(self)))

    def columns(self) -> dict[str, NDArray[Any]]:
        """Name → array of every column that is present."""
        named = ((field.name, getattr(self, field.name)) for field in fields(self))
        return {name: column for name, column in named if column is not None}

    def with_columns(self, **columns: Any) -> Self:
        """Copy with some columns replaced."""
        return replace(self, **columns)

    @classmethod
    def empty(cls, descriptor_length: int | None = None) -> Self:
        """No key points; `descriptors` is (0, descriptor_length), or None."""
        none: Any = np.zeros(0)
        descriptors = None if descriptor_length is None else np.zeros((0, descriptor_length), np.float32)
        return cls(np.zeros((0, 2), np.float32), none, none, none, none, none, none, descriptors)

    @classmethod
    def concatenate(cls, parts: "Sequence[Self]") -> Self:
        """Join key points end to end; all or none must have descriptors of one length.

        Raises
        ------
        InputError
            If only some parts have descriptors, or their lengths differ.
        """
        if not parts:
            return cls.empty()
        lengths = {None if part.descriptors is None else part.descriptors.shape[1] for part in parts}
        if len(lengths) > 1:
            raise InputError(f"key points to join: expected descriptors of one length, got lengths {lengths}")
        names = parts[0].columns()
        return cls(**{name: np.concatenate([getattr(part, name) for part in parts]) for name in names})

    def to_opencv(self) -> list[Any]:
        """Return a list of `cv2.KeyPoint`, the Laplacian as `class_id`; descriptors stay behind."""
        rows = zip(self.xy, self.size, self.angle, self.response, self.octave, self.laplacian, strict=True)
        return [
            cv2.KeyPoint(float(x), float(y), float(size), float(angle), float(response), int(octave), int(sign))
            for (x, y), size, angle, response, octave, sign in rows
        ]

    @classmethod
    def from_opencv(cls, keypoints: Sequence[Any], descriptors: ArrayLike | None = None) -> Self:
        """Convert a sequence of `cv2.KeyPoint`; `scale` is their size, class ids outside {−1, 0, 1} become 0."""
        class_ids = np.array([point.class_id for point in keypoints], dtype=np.int64)
        size = np.array([point.size for point in keypoints], dtype=np.float32)
        return cls(
            xy=np.array([point.pt for point in keypoints], dtype=np.float32).reshape(-1, 2),
            size=size,
            angle=np.array([point.angle for point in keypoints], dtype=np.float32),
            response=np.array([point.response for point in keypoints], dtype=np.float32),
            octave=np.array([point.octave for point in keypoints], dtype=np.int32),
            laplacian=np.where(np.abs(class_ids) <= 1, class_ids, 0).astype(np.int8),
            scale=size.copy(),
            descriptors=None if descriptors is None else np.asarray(descriptors, dtype=np.float32),
        )

    def save(self, path: str | Path, settings: "Mapping[str, object] | None" = None) -> None:
        """Write a .npz, .csv or .json file, by the name's ending; `settings` are kept beside the columns."""
        write_columns(self.columns(), Path(path), settings or {})

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read what `save` wrote.

        Raises
        ------
        InputError
            If the file is missing, damaged, or lacks a column.
        """
        return cls(**read_columns(Path(path)))


def _column(name: str, value: ArrayLike, dtype: type[np.generic], count: int) -> NDArray[Any]:
    """One column as an array of its dtype, its shape checked against the count of key points."""
    column = np.asarray(value, dtype=dtype)
    if name == "descriptors":
        fits, expected = column.ndim == 2 and len(column) == count, f"({count}, d)"
    else:
        shape = (count, 2) if name == "xy" else (count,)
        fits, expected = column.shape == shape, str(shape)
    if not fits:
        raise InputError(f"keypoints.{name}: expected shape {expected}, got {column.shape}")
    return column
