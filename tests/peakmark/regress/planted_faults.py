"""A suite's frames with the noise of many seeds, and what a sound detector and faulty ones find in them."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from hashlib import sha256

from peaksim.camera.frame import Frame
from peaksim.camera.sensor import apply_sensor
from peaksim.corpus.plan import FramePlan, plan_frame
from peaksim.rendering import render

from peakmark.regress.detector import DetectorSettings
from peakmark.regress.frame import ScoredFrame, score_answer
from peakmark.regress.record import Record
from peakmark.regress.suite import Suite
from peakmark.score.wanted import Wanted
from tests.user_detectors import with_faults


@dataclass(frozen=True)
class Scene:
    """A frame that is rendered once and taken with any seed's noise."""

    plan: FramePlan
    frame: Frame


def rendered(suite: Suite, frames: tuple[int, ...]) -> list[Scene]:
    """Return a suite's frames before the sensor."""
    plans = [plan_frame(suite.table.corpus, suite.folder, index) for index in frames]
    renderer = suite.table.corpus.renderer
    return [Scene(p, render(p.scene, p.camera, p.world_from_camera, renderer=renderer, time_s=p.time_s)) for p in plans]


def records_of(suite: Suite, scenes: list[Scene], seed: int) -> dict[str, Record]:
    """Return the record of the sound detector, under "sound", and of each faulty one."""
    wanted = Wanted(min_side_px=suite.table.min_side_px, kinds=suite.table.kinds)
    rows = [dict(_results(scene, seed, wanted, suite.table.tolerance_px)) for scene in scenes]
    return {
        name: Record(
            suite.table.name,
            suite.sha256,
            DetectorSettings(name, stretch=1.5),
            seed,
            "exact",
            {},
            dict(suite.table.tolerances),
            tuple(row[name] for row in rows),
        )
        for name in rows[0]
    }


def _results(scene: Scene, seed: int, wanted: Wanted, tolerance_px: float) -> Iterator[tuple[str, ScoredFrame]]:
    plan = replace(scene.plan, seed=seed)
    image = apply_sensor(scene.frame, plan.sensor, plan.noise()).image
    digest = sha256(image.tobytes()).hexdigest()[:16]
    for name, found in with_faults(image).items():
        yield name, score_answer(plan.index, digest, scene.frame.truth, found, wanted, tolerance_px)
