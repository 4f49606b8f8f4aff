"""Names of the files of a corpus, relative to its folder or bucket, always with slashes; CORPUS.md draws the tree."""

import re

from peaksim.corpus.spec import CorpusSpec, StoreTable

FORMAT = "peakmark-corpus-1"
"""Version of the format that CORPUS.md defines."""

CONFIGURATION = "corpus.json"
MANIFEST = "manifest.json"

_SAFE = re.compile(r"[A-Za-z0-9][A-Za-z0-9 _.-]*(/[A-Za-z0-9][A-Za-z0-9 _.-]*)*")

SUFFIXES = {"png": "png", "jpeg": "jpg"}


def frame_key(index: int) -> str:
    """Return a frame's name, which is also its key in WebDataset shards."""
    return f"{index:08d}"


def shard_key(shard: int) -> str:
    """Return a shard's name."""
    return f"{shard:06d}"


def image_name(spec: CorpusSpec, index: int) -> str:
    """Return the name of a frame's image."""
    return f"{_frames_folder(spec.store, index)}{frame_key(index)}.{SUFFIXES[spec.pictures.format]}"


def record_name(spec: CorpusSpec, index: int) -> str:
    """Return the name of a frame's record."""
    return f"{_frames_folder(spec.store, index)}{frame_key(index)}.json"


def _frames_folder(store: StoreTable, index: int) -> str:
    return frames_folder(index // store.shard_frames)


def frames_folder(shard: int) -> str:
    """Return the folder of a shard's loose files, with a slash at its end."""
    return f"frames/{shard_key(shard)}/"


def shard_name(shard: int) -> str:
    """Return the name of a WebDataset shard."""
    return f"shards/{shard_key(shard)}.tar"


def records_name(shard: int) -> str:
    """Return the name of the file with all records of a shard, one a line."""
    return f"records/{shard_key(shard)}.jsonl"


def shard_sums_name(shard: int) -> str:
    """Return the name of a shard's check sums; the file is written last: it means that the shard is complete."""
    return f"sums/shard-{shard_key(shard)}.sha256"


TABLES = (
    "frames.parquet",
    "markers.parquet",
    "coco_keypoints.json",
    "poses_tum.txt",
    "colmap/cameras.txt",
    "colmap/images.txt",
    "colmap/points3D.txt",
)
"""The files of a part."""


def part_name(part: int, name: str) -> str:
    """Return the name of one of a part's tables."""
    return f"tables/{part:06d}/{name}"


def part_sums_name(part: int) -> str:
    """Return the name of a part's check sums, written last."""
    return f"sums/part-{part:06d}.sha256"


def camera_name(camera: str) -> str:
    """Return the name of a camera's OpenCV calibration."""
    return f"cameras/{camera}.yaml"


def camera_names(spec: CorpusSpec) -> tuple[str, ...]:
    """Return the names of a corpus's cameras: those of `[[cameras]]`, or else each scene's own."""
    return spec.camera_names or tuple(f"scene-{i:03d}" for i in range(len(spec.scenes)))


# --- which frames are where -----------------------------------------------------------------------------------


def shard_count(spec: CorpusSpec) -> int:
    """Return how many shards there are; the last may be shorter."""
    return -(-spec.frames // spec.store.shard_frames)


def part_count(spec: CorpusSpec) -> int:
    """Return how many parts there are; the last may be shorter."""
    return -(-spec.frames // spec.store.part_frames)


def shard_frames(spec: CorpusSpec, shard: int) -> range:
    """Return the indices of a shard's frames."""
    size = spec.store.shard_frames
    return range(shard * size, min((shard + 1) * size, spec.frames))


def part_shards(spec: CorpusSpec, part: int) -> range:
    """Return the numbers of a part's shards."""
    size = spec.store.part_frames // spec.store.shard_frames
    return range(part * size, min((part + 1) * size, shard_count(spec)))


# --- which files are listed where -------------------------------------------------------------------------------


def shard_files(spec: CorpusSpec, shard: int) -> list[str]:
    """Return the names of a shard's files, which its sums list."""
    frames = shard_frames(spec, shard) if spec.store.files else ()
    loose = [name for index in frames for name in (image_name(spec, index), record_name(spec, index))]
    return [*([shard_name(shard)] if spec.store.shards else []), records_name(shard), *loose]


def part_files(spec: CorpusSpec, part: int) -> list[str]:
    """Return the names of a part's tables and of its shards' sums, which its sums list."""
    return [*(part_name(part, name) for name in TABLES), *map(shard_sums_name, part_shards(spec, part))]


def manifest_files(spec: CorpusSpec) -> list[str]:
    """Return the names of the files that the manifest lists."""
    cameras = [camera_name(name) for name in camera_names(spec)]
    return [CONFIGURATION, *cameras, *map(part_sums_name, range(part_count(spec)))]


def listed_in(spec: CorpusSpec, name: str) -> list[str]:
    """Return the names that the manifest or a list of check sums must have; none if there is no such list."""
    if name == MANIFEST:
        return manifest_files(spec)
    found = re.fullmatch(r"sums/(shard|part)-([0-9]{6,8})\.sha256", name)
    if found is None:
        return []
    files, count = {"shard": (shard_files, shard_count), "part": (part_files, part_count)}[found[1]]
    number = int(found[2])
    return files(spec, number) if number < count(spec) else []
