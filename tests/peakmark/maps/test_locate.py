"""`locate`: the camera on maps of arrays, of single markers and of several sheets; or in words why not."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from peaksim import Camera, load_scene, render
from peaksim.geometry.pose import Pose, invert, look_at, pose_distance
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from peakmark.errors import InputError
from peakmark.found.found import Found, find
from peakmark.localise.locate import FloorMap
from peakmark.maps.files import load_map
from peakmark.maps.locate import Location, locate, location_or_reason
from peakmark.maps.marker_map import MarkerMap
from tests.peakmark.maps.map_views import detections
from tests.peakmark.maps.test_files import write_sheet
from tests.photographs import pose_over

CAMERA = Camera(1280, 960, 1100.0, distortion=(-0.1, 0.03, 0.001, 0.0005))
INSIDE = look_at([0.3, -0.2, 1.5], [0.0, 2.0, 1.4])


def located(seen: object, marker_map: MarkerMap | FloorMap, camera: Camera = CAMERA) -> Location:
    where = location_or_reason(seen, camera, marker_map)  # type: ignore[arg-type]
    assert isinstance(where, Location), where
    return where


def assert_near(where: Location, pose: Pose, mm: float, deg: float) -> None:
    distance_m, angle_deg = pose_distance(where.world_from_camera, pose)
    assert 1000 * distance_m <= mm
    assert angle_deg <= deg


@pytest.fixture(scope="module")
def sheet(tmp_path_factory: pytest.TempPathFactory) -> MarkerMap:
    """Return one page of a sheet with more than one array."""
    return load_map(write_sheet(tmp_path_factory.mktemp("sheet"), "array", 25.0)).pieces[0]


@pytest.mark.parametrize(("tilt", "roll"), [(10, 0), (35, 77), (60, 200)])
def test_exact_detections_give_the_exact_pose(sheet: MarkerMap, tilt: float, roll: float) -> None:
    pose = pose_over(0.5, tilt, 40, roll)
    seen = detections(sheet, CAMERA, pose)
    where = located(seen, sheet)
    assert_near(where, pose, 1e-3, 1e-4)
    assert where.is_certain
    assert (where.marker_of == [marker.id for marker in seen]).all()
    assert where.rms_px < 1e-5


def test_a_location_is_one_row_of_a_data_frame(sheet: MarkerMap) -> None:
    pytest.importorskip("pandas")
    pose = pose_over(0.5, 30, 40, 0)
    table = located(detections(sheet, CAMERA, pose), sheet).to_dataframe()
    assert len(table) == 1
    assert table[["tx", "ty", "tz"]].to_numpy()[0] == pytest.approx(pose[:3, 3], abs=1e-6)
    assert {"qw", "sigma_x_m", "sigma_deg", "is_certain", "other_tx", "c00", "c55"} <= set(table.columns)


def test_the_stated_covariance_is_that_of_the_errors(sheet: MarkerMap) -> None:
    """The squared errors over the covariance add up as χ² of six per view, or less: shapes are given half weight."""
    rng, nees = np.random.default_rng(0), []
    for _ in range(20):
        pose = pose_over(rng.uniform(0.4, 0.8), rng.uniform(20, 50), rng.uniform(0, 360), rng.uniform(0, 360))
        where = located(detections(sheet, CAMERA, pose, rng), sheet)
        step = invert(where.world_from_camera) @ pose
        error = np.concatenate([Rotation.from_matrix(step[:3, :3]).as_rotvec(), step[:3, 3]])
        nees.append(error @ np.linalg.solve(where.covariance, error))
    assert chi2.ppf(0.001, 6 * 20) / 20 < np.mean(nees) < chi2.ppf(0.999, 6 * 20) / 20


def test_markers_that_are_not_on_the_map_or_elsewhere_are_left_out(sheet: MarkerMap) -> None:
    rng, pose = np.random.default_rng(1), pose_over(0.5, 30, 0, 0)
    seen = detections(sheet, CAMERA, pose, rng)
    moved = seen[-1]
    moved.xy[0] += 3.0  # within its place's gate, but 100 σ off
    stranger = detections(sheet, CAMERA, pose_over(0.6, 10, 90, 0), rng)[0]
    where = located([*seen, stranger], sheet)
    assert_near(where, pose, 0.5, 0.05)
    assert where.marker_of[-2:].tolist() == [-1, -1]
    assert (where.marker_of[:-2] >= 0).all()


def test_a_marker_of_another_size_is_not_the_one_that_is_expected_there(sheet: MarkerMap) -> None:
    pose = pose_over(0.5, 30, 0, 0)
    seen = detections(sheet, CAMERA, pose)
    last = seen[-1]
    assert last.affinity is not None
    where = located([*seen[:-1], replace(last, affinity=2.5 * last.affinity, size=2.5 * last.size)], sheet)
    assert where.marker_of.tolist() == [*range(len(seen) - 1), -1]
    assert_near(where, pose, 1e-3, 1e-4)


def test_the_sheet_that_is_seen_is_told(tmp_path: Path) -> None:
    several = load_map(write_sheet(tmp_path, "array", 40.0))
    pose = pose_over(0.6, 30, 10, 20)
    for number, page in enumerate(several.pieces, 1):
        where = located(detections(page, CAMERA, pose), several)
        assert where.page == number
        assert_near(where, pose, 1e-3, 1e-4)
        assert several.pages is not None
        assert (several.pages[where.marker_of] == number).all()


def test_walls_of_a_room_from_its_image() -> None:
    scene, camera, trajectory = load_scene("cave")
    pose = trajectory.at(0.0)
    image, room = render(scene, camera, pose).image, load_map("cave")
    where = locate(image, camera, room)
    assert where is not None
    assert_near(where, pose, 3.0, 0.1)
    told = located(find(image, layout=room.layout, focal_px=camera.focal_px), room, camera)
    assert np.array_equal(where.world_from_camera, told.world_from_camera)
    assert np.array_equal(where.covariance, told.covariance)


def test_markers_without_names_on_a_floor_and_on_a_wall() -> None:
    floor = load_map("hall")
    pose = load_scene("hall").trajectory.at(0.0)
    camera = load_scene("hall").camera
    rng = np.random.default_rng(2)
    seen = detections(floor, camera, pose, rng)
    for on_floor in (floor, FloorMap(floor.centers_m, 0.08)):
        assert_near(located(seen, on_floor, camera), pose, 5, 0.3)
    wall = wall_of(np.array([[0, 0], [0.3, 0.02], [0.1, 0.31], [0.45, 0.4], [-0.2, 0.35], [0.2, -0.3]]))
    assert_near(located(detections(wall, CAMERA, INSIDE, rng), wall), INSIDE, 8, 0.4)


def wall_of(xy_m: NDArray[np.float64]) -> MarkerMap:
    """Return single dark markers on the wall y = 2, 1.4 m up, which faces −y."""
    centers = np.column_stack([xy_m[:, 0], np.full(len(xy_m), 2.0), xy_m[:, 1] + 1.4])
    axes = np.broadcast_to(np.array([[1.0, 0.0], [0.0, 0.0], [0.0, -1.0]]), (len(xy_m), 3, 2))
    return MarkerMap(centers, axes, np.full(len(xy_m), 0.1), ("dark",) * len(xy_m))


def test_an_arrangement_that_looks_the_same_turned_is_no_pose() -> None:
    square = wall_of(np.array([[-0.2, -0.2], [0.2, -0.2], [-0.2, 0.2], [0.2, 0.2]]))
    reason = location_or_reason(detections(square, CAMERA, INSIDE), CAMERA, square)
    assert isinstance(reason, str)
    assert "the markers do not tell where they are on the map (4 seen, 4 on it)" in reason
    assert locate(detections(square, CAMERA, INSIDE), CAMERA, square) is None


def test_nothing_seen_and_other_arrays_say_so(sheet: MarkerMap, tmp_path: Path) -> None:
    assert location_or_reason([], CAMERA, sheet) == "no marker was found"
    other = load_map(write_sheet(tmp_path, "array-7", 40.0))
    seen = detections(other, CAMERA, pose_over(0.5, 10, 0, 0))
    reason = location_or_reason(seen, CAMERA, sheet)
    codes = ", ".join(str(array.code) for array in sheet.arrays)
    if "7" not in codes:
        assert reason == f"expected one of the map's arrays {codes}, found arrays 7"


def test_an_image_of_another_size_is_refused(sheet: MarkerMap) -> None:
    with pytest.raises(InputError, match="expected an image of the camera's 1280×960 px, got 640×480"):
        locate(np.zeros((480, 640), np.uint8), CAMERA, sheet)
    with pytest.raises(InputError, match="got 9×9"):
        locate(Found((), (), (9, 9)), CAMERA, sheet)
