"""The boards, all of one paper: ours, OpenCV's ChArUco and its chessboard; and what each detector sees of them."""

from dataclasses import dataclass
from functools import cache
from typing import Any, Literal, get_args

import cv2
import numpy as np
from numpy.typing import NDArray
from peaksim.camera.sensor import apply_sensor
from peaksim.image_file import to_8_bits
from peaksim.rendering import render
from peaksim.scene.scene import Quad, Scene
from peaksim.scene.texture import Texture

from peakmark.calibration.views import FEWEST, BoardView, board_view
from peakmark.experiments.calibration.study import SimulatedCamera, StudyConfig, simulated_camera
from peakmark.found.found import find
from peakmark.maps.files import board_arrays
from peakmark.maps.marker_map import MarkerMap
from peakmark.markers.board import BOARD_LAYOUT, board_page
from peakmark.markers.sheet import paper_size
from peakmark.markers.sheet_files import raster

Board = Literal["peakmark", "charuco", "chessboard"]
BOARDS: tuple[Board, ...] = get_args(Board)

_DPI = 254.0
"""Ten texels to a millimetre, of all boards."""

_SQUARES, _SQUARE_MM, _TAG_MM = (10, 14), 28.0, 21.0
"""Columns and rows of OpenCV's boards, and sides of a square and of an ArUco marker on it."""

_LEVELS = (25, 215)
"""Grey levels of ink and paper."""

_NOISE = 7
"""Stream of the sensor's noise beside that of lens and poses."""


@dataclass(frozen=True)
class SeenBoard:
    """What one photograph shows of a board; nothing where its detector found too little."""

    rows: tuple[int, ...]
    """Markers or corners, as numbers on the board."""
    xy: tuple[tuple[float, float], ...]
    """Where they are seen, px."""
    sigma_px: tuple[float, ...]
    """Stated errors up to a factor; 1 for OpenCV's boards, which state none."""


def photographed(config: StudyConfig, index: int) -> dict[Board, SeenBoard]:
    """Return what one pose of one camera shows of each board; the index counts views, camera by camera."""
    number, view = divmod(index, config.views)
    simulated = simulated_camera(config, number)
    return {board: _seen(board, photograph(config, simulated, number, view, board)) for board in BOARDS}


def photograph(
    config: StudyConfig, simulated: SimulatedCamera, number: int, view: int, board: Board
) -> NDArray[np.uint8]:
    """Return (960, 1280) a board as the camera photographs it."""
    frame = render(_scene(board), simulated.camera, simulated.poses[view], renderer="exact")
    rng = np.random.default_rng((config.seed, number, view, _NOISE))
    return to_8_bits(apply_sensor(frame, simulated.sensor, rng).image)


def points_m(board: Board) -> NDArray[np.float64]:
    """Return (n, 3) markers' centres or squares' corners, by their number: x right, y up, the middle the origin."""
    if board == "peakmark":
        return board_map().centers_m
    columns, rows = _SQUARES
    x, y = np.meshgrid(np.arange(1, columns) - columns / 2, rows / 2 - np.arange(1, rows))
    return np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)]) * _SQUARE_MM / 1000


@cache
def board_map() -> MarkerMap:
    """Return the map of `peakmark marker board --paper a3`."""
    page, _ = board_page(paper_size("a3"))
    size_mm = np.array([page.width_mm, page.height_mm])
    xy_mm = np.array([(placed.x_mm, placed.y_mm) for placed in page.markers])
    polarities = tuple(placed.marker.polarity for placed in page.markers)
    return MarkerMap(
        np.column_stack([(xy_mm - size_mm / 2) * [1, -1] / 1000, np.zeros(len(xy_mm))]),
        np.broadcast_to(np.array([[1.0, 0.0], [0.0, -1.0], [0.0, 0.0]]), (len(xy_mm), 3, 2)),
        np.array([placed.marker.side_mm for placed in page.markers]) / 1000,
        polarities,
        board_arrays(polarities, BOARD_LAYOUT),
        BOARD_LAYOUT,
    )


@cache
def _scene(board: Board) -> Scene:
    width_mm, height_mm = paper_size("a3")
    ink, paper = _LEVELS
    texture = Texture.from_array(np.rint(ink + _printed(board) / 255 * (paper - ink)).astype(np.uint8))
    size_m = (width_mm / 1000, height_mm / 1000)
    return Scene(quads=(Quad(name=board, texture=texture, size_m=size_m, world_from_quad=np.eye(4), marker=None),))


def _printed(board: Board) -> NDArray[np.uint8]:
    """Return the page, (4200, 2970) texels."""
    page, _ = board_page(paper_size("a3"))
    if board == "peakmark":
        return to_8_bits(raster(page, _DPI))
    columns, rows = _SQUARES
    side = round(_SQUARE_MM * _DPI / 25.4)
    if board == "charuco":
        pattern = _charuco().generateImage((columns * side, rows * side))
    else:
        squares = np.indices((rows, columns)).sum(axis=0) % 2
        pattern = np.kron(255 * squares, np.ones((side, side), np.int64)).astype(np.uint8)
    full = np.full_like(to_8_bits(raster(page, _DPI)), 255)
    height, width = rows * side, columns * side
    top, left = (full.shape[0] - height) // 2, (full.shape[1] - width) // 2
    full[top : top + height, left : left + width] = pattern
    return full


@cache
def _charuco() -> cv2.aruco.CharucoBoard:
    tags = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_100)
    return cv2.aruco.CharucoBoard(_SQUARES, _SQUARE_MM / 1000, _TAG_MM / 1000, tags)


# --- what detectors see ---------------------------------------------------------------------------------------


def _seen(board: Board, image: NDArray[np.uint8]) -> SeenBoard:
    if board == "peakmark":
        view = board_view("", find(image, layout=BOARD_LAYOUT), board_map())
        if not isinstance(view, BoardView):
            return SeenBoard((), (), ())
        return _plain(view.rows, view.xy, view.sigma_px)
    found: Any
    if board == "charuco":
        xy, found, _, _ = cv2.aruco.CharucoDetector(_charuco()).detectBoard(image)
    else:
        size = (_SQUARES[0] - 1, _SQUARES[1] - 1)
        is_found, xy = cv2.findChessboardCornersSB(image, size, flags=cv2.CALIB_CB_ACCURACY)
        found = np.arange(size[0] * size[1]) if is_found else None
    if found is None or len(found) < FEWEST:
        return SeenBoard((), (), ())
    return _plain(np.asarray(found).ravel(), xy.reshape(-1, 2), np.ones(len(found)))


def _plain(rows: NDArray[Any], xy: NDArray[Any], sigma_px: NDArray[Any]) -> SeenBoard:
    places = tuple((float(x), float(y)) for x, y in xy)
    return SeenBoard(tuple(map(int, rows)), places, tuple(map(float, sigma_px)))
