"""Calibration files of others: what they say of a camera, as plain fields of `Camera`, and back.

| format | file | what it is told by |
|---|---|---|
| OpenCV, and a corpus's own | YAML, XML, JSON | `camera_matrix`, `distortion_coefficients`; also K and D |
| ROS | `camera_info` as YAML | the same names, or the message's own: `K`, `D`, `width`, `height` |
| Kalibr | camchain YAML | a table a camera with `camera_model` and `intrinsics` |
| COLMAP | `cameras.txt` | lines `ID MODEL WIDTH HEIGHT PARAMETERS…` |

OpenCV, ROS and Kalibr have the centres of pixels at integers, as here; COLMAP has them at +½.
"""

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import yaml

from peaksim.errors import InputError, check_choice
from peaksim.text_file import read_text
from peaksim.whole_file import write_whole

Fields = dict[str, Any]
"""width, height, fx, fy, cx, cy, distortion and model of a `Camera`."""

FORMATS = ("opencv", "ros", "kalibr", "colmap")
"""Formats that are written."""

_LARGEST_FILE = 200_000  # bytes
_FAULTS = (yaml.YAMLError, ValueError, TypeError, LookupError, RecursionError, SystemError, cv2.error)  # of parsers
_OPENCV_ENDINGS = (".yaml", ".yml", ".xml", ".json")
_SIZES = (("image_width", "image_height"), ("width", "height"), ("image_Width", "image_Height"))
_MATRICES = ("camera_matrix", "Camera_Matrix", "cameraMatrix", "K", "k", "mtx")
_DISTORTIONS = ("distortion_coefficients", "Distortion_Coefficients", "distCoeffs", "D", "d", "dist")
_LENSES = {
    "plumb_bob": "brown",
    "rational_polynomial": "brown",
    "thin_prism_fisheye": None,
    "radtan": "brown",
    "none": "brown",
    "equidistant": "fisheye",
    "fisheye": "fisheye",
    "brown": "brown",
}
_COLMAP = {  # model → how many focal lengths, names of the distortion, lens
    "SIMPLE_PINHOLE": (1, "", "brown"),
    "PINHOLE": (2, "", "brown"),
    "SIMPLE_RADIAL": (1, "k1", "brown"),
    "RADIAL": (1, "k1 k2", "brown"),
    "OPENCV": (2, "k1 k2 p1 p2", "brown"),
    "FULL_OPENCV": (2, "k1 k2 p1 p2 k3 k4 k5 k6", "brown"),
    "OPENCV_FISHEYE": (2, "k1 k2 k3 k4", "fisheye"),
    "SIMPLE_RADIAL_FISHEYE": (1, "k1", "fisheye"),
    "RADIAL_FISHEYE": (1, "k1 k2", "fisheye"),
}


def read_calibration(path: str | Path) -> Fields:
    """Return a camera's fields; FILE#NAME chooses one camera of a file that has several.

    Raises
    ------
    InputError
        One line that names the file: it is missing, in none of the formats, lacks a field, has a lens that `Camera`
        does not know, or holds several cameras and none was chosen.
    """
    file, name = _split(str(path))
    text = read_text(file, _LARGEST_FILE)
    try:
        return _chosen(_cameras(text), name)
    except InputError as error:
        raise InputError(f"{file}: {error}") from error
    except (
        yaml.YAMLError,
        ValueError,
        TypeError,
        KeyError,
        IndexError,
        RecursionError,
        SystemError,
        cv2.error,
    ) as error:
        raise InputError(f"{file}: expected a calibration (OpenCV, ROS, Kalibr or COLMAP): {error!r:.200}") from error


def _split(path: str) -> tuple[Path, str | None]:
    name, _, camera = path.rpartition("#")
    return (Path(name), camera) if name and not Path(path).exists() else (Path(path), None)


def _chosen(cameras: Mapping[str, Fields], name: str | None) -> Fields:
    if name is None and len(cameras) == 1:
        return next(iter(cameras.values()))
    if name is None or name not in cameras:
        got = "several" if name is None else repr(name)
        raise InputError(
            f"expected one of the cameras {', '.join(cameras)}, as in FILE#{next(iter(cameras))}, got {got}"
        )
    return cameras[name]


def _cameras(text: str) -> dict[str, Fields]:
    """Return the cameras of a file by name."""
    if text.lstrip().startswith("<"):
        return {"camera": _from_matrix(_xml_values(text))}
    if _is_colmap(text):
        return _colmap_cameras(text)
    values = json.loads(text) if text.lstrip().startswith("{") else _yaml_values(text)
    if not isinstance(values, dict):
        raise InputError(f"expected a calibration (OpenCV, ROS, Kalibr or COLMAP), got {type(values).__name__}")
    chain = {str(k): v for k, v in values.items() if isinstance(v, dict) and {"camera_model", "intrinsics"} <= v.keys()}
    return {name: _from_kalibr(table) for name, table in chain.items()} or {"camera": _from_matrix(values)}


_Loader: Any = type("_Loader", (yaml.SafeLoader,), {"__doc__": "YAML that also knows OpenCV's matrices."})
_Loader.add_constructor("tag:yaml.org,2002:opencv-matrix", lambda loader, node: loader.construct_mapping(node, True))


def _yaml_values(text: str) -> Any:
    lines = [line for line in text.splitlines() if not line.startswith("%YAML")]  # OpenCV's own is no YAML
    return yaml.load("\n".join(lines), _Loader)


def _xml_values(text: str) -> Fields:
    """Return what OpenCV finds in its own XML."""
    storage = cv2.FileStorage(text, cv2.FileStorage_READ | cv2.FileStorage_MEMORY | cv2.FileStorage_FORMAT_XML)
    values: Fields = {}
    for name in storage.root().keys():  # noqa: SIM118 — a node is no dict
        node = storage.getNode(name)
        values[name] = node.mat() if node.isMap() else node.string() if node.isString() else node.real()
    return values


def _first(values: Mapping[str, Any], names: Iterable[str]) -> Any:
    return next((values[name] for name in names if values.get(name) is not None), None)


def _numbers(value: Any) -> list[float]:
    """Return the numbers of a matrix {rows, cols, data}, of nested lists, or of an array, row by row."""
    if isinstance(value, Mapping):
        value = value["data"]
    return [float(number) for number in np.asarray(value, dtype=np.float64).ravel()]


def _from_matrix(values: Mapping[str, Any]) -> Fields:
    """Return the camera of a matrix and its distortion: OpenCV's and ROS's files."""
    size = next(((values[w], values[h]) for w, h in _SIZES if {w, h} <= values.keys()), None)
    matrix = _first(values, _MATRICES)
    if matrix is None or size is None:
        missing = "camera_matrix" if matrix is None else "image_width and image_height"
        raise InputError(f"expected a calibration with camera_matrix, image_width and image_height; {missing} missing")
    fx, skew, cx, _, fy, cy, *last = _numbers(matrix)
    if last != [0, 0, 1] or skew or not _is_unscaled(values):
        raise InputError(f"expected a camera matrix fx 0 cx, 0 fy cy, 0 0 1 of the whole image, got {_numbers(matrix)}")
    distortion = _first(values, _DISTORTIONS)
    lens = "fisheye" if _first(values, ("fisheye_model",)) else values.get("distortion_model") or "brown"
    return {
        **_size(*size),
        "fx": fx,
        "fy": fy,
        "cx": cx,
        "cy": cy,
        "distortion": _trimmed([] if distortion is None else _numbers(distortion)),
        "model": _lens(lens),
    }


def _is_unscaled(values: Mapping[str, Any]) -> bool:
    """Return whether a ROS message is of the whole image, neither binned nor cut out."""
    region = values.get("roi") or {}
    return all(values.get(name) in (None, 0, 1) for name in ("binning_x", "binning_y")) and not any(
        region.get(name) for name in ("x_offset", "y_offset", "width", "height")
    )


def _size(width: Any, height: Any) -> Fields:
    if int(width) != width or int(height) != height:
        raise InputError(f"expected an image size in whole pixels, got {width}×{height}")
    return {"width": int(width), "height": int(height)}


def _lens(name: Any) -> str:
    lens = _LENSES.get(str(name))
    if lens is None:
        known = ", ".join(name for name, lens in _LENSES.items() if lens is not None)
        raise InputError(f"distortion_model: expected one of {known}, got {name!r}")
    return lens


def _trimmed(distortion: list[float]) -> tuple[float, ...]:
    """Return coefficients, none where all are 0."""
    return tuple(distortion) if any(distortion) else ()


def _from_kalibr(table: Mapping[str, Any]) -> Fields:
    if table["camera_model"] != "pinhole":
        raise InputError(f"camera_model: expected pinhole, got {table['camera_model']!r}")
    fx, fy, cx, cy = _numbers(table["intrinsics"])
    distortion = _trimmed(_numbers(table.get("distortion_coeffs", ())))
    lens = _lens(table.get("distortion_model", "none"))
    return {
        **_size(*table["resolution"]),
        "fx": fx,
        "fy": fy,
        "cx": cx,
        "cy": cy,
        "distortion": distortion,
        "model": lens,
    }


def _is_colmap(text: str) -> bool:
    lines = [line.split() for line in text.splitlines() if line.strip() and not line.startswith("#")]
    return bool(lines) and all(len(words) > 4 and words[0].isdigit() and words[1].isupper() for words in lines)


def _colmap_cameras(text: str) -> dict[str, Fields]:
    cameras = {}
    for line in text.splitlines():
        if line.strip() and not line.startswith("#"):
            number, model, width, height, *values = line.split()
            cameras[number] = _from_colmap(model, int(width), int(height), [float(value) for value in values])
    return cameras


def _from_colmap(model: str, width: int, height: int, values: list[float]) -> Fields:
    if model not in _COLMAP:
        raise InputError(f"expected a camera model of {', '.join(_COLMAP)}, got {model}")
    focals, terms, lens = _COLMAP[model]
    expected = focals + 2 + len(terms.split())
    if len(values) != expected:
        raise InputError(f"expected {expected} parameters for {model}, got {len(values)}")
    focal, (cx, cy), k = values[:focals], values[focals : focals + 2], values[focals + 2 :]
    if k and len(k) < 4:
        k += [0.0] * (4 - len(k))
    size = {"width": width, "height": height, "fx": focal[0], "fy": focal[-1], "cx": cx - 0.5, "cy": cy - 0.5}
    return {**size, "distortion": _trimmed(k), "model": lens}


# --- writing --------------------------------------------------------------------------------------------------


def write_calibration(camera: Fields, path: Path, name: str = "camera", format: str | None = None) -> None:
    """Write a camera's fields in one of `FORMATS`: OpenCV's by the ending .yaml, .xml or .json, COLMAP's by .txt.

    Raises
    ------
    InputError
        If the format is unknown, follows from no ending, or has no model of the lens.
    """
    if format is None:
        format = "colmap" if path.suffix == ".txt" else "opencv"
    check_choice(format, FORMATS, "format")
    if format == "opencv":
        if path.suffix not in _OPENCV_ENDINGS:
            raise InputError(f"{path}: expected a name ending in {', '.join(_OPENCV_ENDINGS)}, or .txt for COLMAP")
        text = opencv_text(camera, name, path.suffix)
    else:
        text = {"ros": _ros_text, "kalibr": _kalibr_text, "colmap": _colmap_text}[format](camera, name)
    write_whole(path, text)


def opencv_text(camera: Fields, name: str, ending: str = ".yaml") -> str:
    """Return what OpenCV's calibration writes: sizes, camera_matrix, distortion_model, distortion_coefficients.

    The distortion is 1×n, zeros for a pinhole; the model is named as ROS does, see `_ros_lens`.
    """
    storage = cv2.FileStorage(f"calibration{ending}", cv2.FileStorage_WRITE | cv2.FileStorage_MEMORY)
    storage.write("camera_name", name)
    storage.write("image_width", camera["width"])
    storage.write("image_height", camera["height"])
    storage.write("camera_matrix", np.array(_matrix(camera)).reshape(3, 3))
    storage.write("distortion_model", _ros_lens(camera))
    storage.write("distortion_coefficients", np.array([_padded(camera)], dtype=np.float64))
    return str(storage.releaseAndGetString())


def _matrix(camera: Fields) -> list[float]:
    return [camera["fx"], 0.0, camera["cx"], 0.0, camera["fy"], camera["cy"], 0.0, 0.0, 1.0]


def _padded(camera: Fields) -> list[float]:
    empty = 4 if camera["model"] == "fisheye" else 5
    return [float(k) for k in camera["distortion"]] or [0.0] * empty


def _ros_lens(camera: Fields) -> str:
    """Return ROS's name: "plumb_bob" up to 5 coefficients, "rational_polynomial" for more, "equidistant"."""
    brown = "rational_polynomial" if len(camera["distortion"]) > 5 else "plumb_bob"
    return "equidistant" if camera["model"] == "fisheye" else brown


def _ros_text(camera: Fields, name: str) -> str:
    projection = [camera["fx"], 0.0, camera["cx"], 0.0, 0.0, camera["fy"], camera["cy"], 0.0, 0.0, 0.0, 1.0, 0.0]
    distortion = _padded(camera)
    values = {
        "image_width": camera["width"],
        "image_height": camera["height"],
        "camera_name": name,
        "camera_matrix": {"rows": 3, "cols": 3, "data": _matrix(camera)},
        "distortion_model": _ros_lens(camera),
        "distortion_coefficients": {"rows": 1, "cols": len(distortion), "data": distortion},
        "rectification_matrix": {"rows": 3, "cols": 3, "data": [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]},
        "projection_matrix": {"rows": 3, "cols": 4, "data": projection},
    }
    return str(yaml.safe_dump(values, sort_keys=False, default_flow_style=None, width=1000))


def _kalibr_text(camera: Fields, name: str) -> str:
    k = [float(value) for value in camera["distortion"]]
    if camera["model"] == "brown" and any(k[4:]):
        raise InputError(f"distortion: expected zeros after the first four, for Kalibr has no model of more, got {k}")
    values = {
        "camera_model": "pinhole",
        "intrinsics": [camera["fx"], camera["fy"], camera["cx"], camera["cy"]],
        "distortion_model": "equidistant" if camera["model"] == "fisheye" else "radtan" if k else "none",
        "distortion_coeffs": k[:4] or [0.0] * 4,
        "resolution": [camera["width"], camera["height"]],
    }
    return str(yaml.safe_dump({name: values}, sort_keys=False, default_flow_style=None, width=1000))


def _colmap_text(camera: Fields, name: str) -> str:
    return f"# {name}\n1 {colmap_line(camera)}\n"


def colmap_line(camera: Mapping[str, Any]) -> str:
    """Return COLMAP's model, size and parameters of a camera, without its number.

    Raises
    ------
    InputError
        If COLMAP has no model of its lens: one with a thin prism or a tilted sensor.
    """
    k = list(camera["distortion"])
    model, distortion = ("OPENCV_FISHEYE", k + [0.0] * (4 - len(k))) if camera["model"] == "fisheye" else _brown(k)
    parameters = [camera["fx"], camera["fy"], camera["cx"] + 0.5, camera["cy"] + 0.5, *distortion]
    return f"{model} {camera['width']} {camera['height']} {joined(parameters)}"


def _brown(k: list[float]) -> tuple[str, list[float]]:
    if not any(k):
        return "PINHOLE", []
    if any(k[8:]):
        raise InputError(
            f"distortion: expected zeros after the first eight coefficients, for COLMAP has no model with a thin prism "
            f"or a tilted sensor, got {k[8:]}"
        )
    return ("OPENCV", k) if len(k) == 4 else ("FULL_OPENCV", (k + [0.0] * 8)[:8])


def joined(values: Iterable[float]) -> str:
    """Return numbers in full, with blanks between, as COLMAP's files have them."""
    return " ".join(repr(float(value)) for value in values)
