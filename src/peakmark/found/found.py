"""One image's markers and arrays in one value: `find`."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from numpy.typing import ArrayLike

from peakmark.arrays.decode import MarkerArray, decode_arrays
from peakmark.found.rows import FoundRow, array_row, marker_row
from peakmark.found.tables import data_frame
from peakmark.identification.api import identify
from peakmark.identification.detection import Detection
from peakmark.keypoints.image import as_gray
from peakmark.markers.array_code import THREE_BIT, Layout
from peakmark.markers.optimum import Limit
from peakmark.markers.patterns import Polarity


@dataclass(frozen=True)
class Found:
    """The markers of one image, and the arrays that they form."""

    markers: tuple[Detection, ...]
    """Strongest first; then those that were found only where a marker of an array had to be."""
    arrays: tuple[MarkerArray, ...]
    """Those with a code first, by code."""
    image_size: tuple[int, int]
    """Width and height, px."""

    def rows(self, file: str = "", frame: int | None = None) -> tuple[FoundRow, ...]:
        """Return one row an array and one a marker, in this order; `file` and `frame` are noted in each."""
        arrays = [array_row(array, file, frame) for array in self.arrays]
        return (*arrays, *(marker_row(marker, file, frame) for marker in self.markers))

    def to_dataframe(self) -> Any:
        """Return the rows as a `pandas.DataFrame`; without pandas an `InputError` says how to install it."""
        return data_frame(self.rows())


def find(
    image: ArrayLike,
    polarity: Polarity | Literal["both"] = "both",
    layout: Layout = THREE_BIT,
    detector: str | Sequence[str] = "surf",
    limit: Limit | Literal["both"] | None = None,
    focal_px: float | None = None,
) -> Found:
    """Return the markers of an image and the arrays among them: `identify`, then `decode_arrays`.

    `image` is grey or RGB, see `as_gray`; a single polarity forms no arrays but those of that polarity alone. `layout`
    is that of the printed arrays. `detector` and `limit` say for which markers to look, and `focal_px`, such as
    `Camera.focal_px`, how strong perspective is: see `identify`.

    Raises
    ------
    InputError
        If the polarity, the detector or the limit is unknown, the focal length is not above 0, or the image is none.
    """
    gray = as_gray(image)
    markers = identify(gray, polarity=polarity, detector=detector, limit=limit, focal_px=focal_px)
    return found_in(gray, markers, layout)


def found_in(image: ArrayLike, markers: Iterable[Detection], layout: Layout = THREE_BIT) -> Found:
    """Return detections with the arrays that they form in their image."""
    gray, kept = as_gray(image), tuple(markers)
    arrays = decode_arrays(kept, layout, image=gray)
    known = {id(marker) for marker in kept}
    looked_for = [marker for array in arrays for marker in array.detections if id(marker) not in known]
    return Found((*kept, *looked_for), arrays, (gray.shape[1], gray.shape[0]))
