"""What the tests of corpora share."""

from pathlib import Path

import pytest

from tests.peaksim.corpus.helpers import write_tiny_scene


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with the scene "tiny.toml"."""
    return write_tiny_scene(tmp_path / "specs")
