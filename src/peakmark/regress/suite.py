"""Suites: on which frames a detector is tested, and what counts; scenes/README.md is the manual."""

from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from peaksim import shipped
from peaksim.corpus.layout import CONFIGURATION
from peaksim.corpus.read import open_corpus
from peaksim.corpus.spec import CorpusSpec
from peaksim.scene.schema import Name, NotNegative, Positive, StrictTable
from peaksim.toml_file import parse_toml, validate
from pydantic import Field

from peakmark.regress.detector import DetectorSettings, Parameter


class DetectorTable(StrictTable):
    """`[detector]`: what is tested unless the command says otherwise."""

    name: str = "markers"
    stretch: Annotated[float, Field(ge=0.25, le=8)] = 2.0
    parameters: dict[str, Parameter] = Field(default_factory=dict)


class SuiteTable(StrictTable):
    """The whole file."""

    name: Name
    quick_frames: Annotated[int, Field(ge=2, le=100_000)] = 40
    min_side_px: NotNegative = 14.0
    tolerance_px: Positive = 3.0
    kinds: tuple[Name, ...] = ()
    detector: DetectorTable = DetectorTable()
    tolerances: dict[str, NotNegative] = Field(default_factory=dict)
    corpus: CorpusSpec


@dataclass(frozen=True)
class Suite:
    """A suite, opened."""

    table: SuiteTable
    """What the file states."""
    folder: Path
    """Beside which its scenes and trajectories are."""
    corpus: str | None = None
    """Folder or URL of a finished corpus whose frames are read; None to render them."""

    @property
    def sha256(self) -> str:
        """Hash of what decides which frames there are and what counts in them; not of the detector or tolerances."""
        deciding = self.table.model_dump_json(exclude={"detector", "tolerances", "quick_frames"})
        return sha256(deciding.encode()).hexdigest()

    def detector(self, **changes: Any) -> DetectorSettings:
        """Return the suite's detector with the changes that are not None."""
        given = {name: value for name, value in changes.items() if value is not None}
        parameters = {**self.table.detector.parameters, **given.pop("parameters", {})}
        if given.get("name", self.table.detector.name) != self.table.detector.name:
            parameters = dict(changes.get("parameters") or {})  # the suite's own are for its own detector
        stated = {"name": self.table.detector.name, "stretch": self.table.detector.stretch}
        return DetectorSettings(**{**stated, **given, "parameters": parameters})

    def frames(self, quick: bool) -> tuple[int, ...]:
        """Return the indices of the frames: all, or for a quick run some in even steps."""
        count = self.table.corpus.frames
        wanted = min(self.table.quick_frames, count) if quick else count
        return tuple(round(float(step)) for step in np.linspace(0, count - 1, wanted))


def load_suite(name: str) -> Suite:
    """Open a suite: a TOML file, the name of one that ships, such as "floor", or a finished corpus.

    Raises
    ------
    InputError
        One line that names the file, the field, what was expected and what came.
    """
    if "://" in name or (Path(name) / CONFIGURATION).is_file():
        spec = open_corpus(name).configuration.spec
        return Suite(SuiteTable(name=spec.name, corpus=spec), Path(), name)
    shipped_file = shipped.SCENES / "experiments" / f"regress_{name}.toml"
    file = shipped_file if Path(name).name == str(name) and shipped_file.is_file() else Path(name)
    return Suite(validate(SuiteTable, parse_toml(file), str(file)), file.parent)
