"""The shipped pictures are those that assets/README.md vouches for."""

import hashlib
import re
import sys

import numpy as np
import pytest
from PIL import Image

from tests.places import ROOT

ASSETS = ROOT / "assets"
sys.path.insert(0, str(ROOT / "tools"))

from make_assets import marker_assets  # noqa: E402

LISTED = dict(re.findall(r"^\| `([^`]+\.png)` \|.*`([0-9a-f]{64})` \|$", (ASSETS / "README.md").read_text(), re.M))


def test_every_picture_is_listed_and_no_other() -> None:
    assert set(LISTED) == {str(p.relative_to(ASSETS)) for p in ASSETS.rglob("*.png")}


@pytest.mark.parametrize("name", LISTED)
def test_checksums(name: str) -> None:
    assert hashlib.sha256((ASSETS / name).read_bytes()).hexdigest() == LISTED[name]


def test_marker_pictures_are_what_the_generator_makes() -> None:
    made = marker_assets()
    assert set(made) == {p.name for p in (ASSETS / "markers").glob("*.png")}
    for name, picture in made.items():
        assert np.array_equal(np.asarray(Image.open(ASSETS / "markers" / name)), picture)


def test_photographs_are_scikit_images_own() -> None:
    from skimage import data

    for name in ("brick", "coins", "grass", "gravel"):
        assert np.array_equal(np.asarray(Image.open(ASSETS / "textures" / f"{name}.png")), getattr(data, name)())
