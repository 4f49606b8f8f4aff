"""make_corpus: claim the destination, render what is missing, make the tables, write the manifest."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from hashlib import sha256
from pathlib import Path

from peaksim.area.faces import count_faces
from peaksim.camera.camera import resized
from peaksim.corpus import layout
from peaksim.corpus.backends import Backend, in_process
from peaksim.corpus.calibration import opencv_yaml
from peaksim.corpus.check_spec import check_spec
from peaksim.corpus.configuration import Configuration, claim_store, make_configuration, manifest_values, to_json
from peaksim.corpus.plan import corpus_cameras, first_frames, plan_frame
from peaksim.corpus.spec import CorpusSpec, spec_from_json, spec_to_json
from peaksim.corpus.store.base import Store, write_file
from peaksim.corpus.store.opening import open_store
from peaksim.corpus.write import Job, Written, open_job, write_part, write_shard
from peaksim.rendering import render

_PROBE_PX = 16  # width of the image that tells which renderer is available


@dataclass(frozen=True)
class Made:
    """The result of a run."""

    frames: int
    """In the corpus."""
    rendered: int
    """By this run; the others existed."""
    damaged: tuple[str, ...]
    """What was wrong with finished files of earlier runs, and was made again; one line a file."""
    configuration: Configuration
    """As corpus.json has it."""


def make_corpus(
    spec: CorpusSpec,
    folder: Path,
    dest: str,
    backend: Backend | None = None,
    on_frames: Callable[[int], None] = lambda count: None,
) -> Made:
    """Make a corpus, or finish one that an earlier run left unfinished; the result is the same, byte for byte.

    Parameters
    ----------
    spec
        What it consists of.
    folder
        Where the specification's scenes and trajectories are.
    dest
        A folder, made if missing, or an fsspec URL.
    backend
        Where frames are rendered: `in_process()`, the default, `processes(n)` or `on_dask(address)`.
    on_frames
        Called with the number of frames that are finished, those of earlier runs first.

    Raises
    ------
    InputError
        One line: the specification contradicts itself, the destination holds something else or cannot be written.
    RendererError
        If rendering fails, or the machine that resumes has another OpenGL renderer than the one that began.
    """
    check_spec(spec, folder)
    backend = backend or in_process()
    store = open_store(dest, new=True)
    with store.alone():
        configuration = make_configuration(spec, folder, *_probe(spec, folder, backend))
        claim_store(store, configuration)
        job = Job(dest, str(folder), sha256(store.read(layout.CONFIGURATION)).hexdigest())
        written: list[Written] = []
        if not store.exists(layout.MANIFEST):
            written += _write_shards(store, job, spec, backend, on_frames)
            parts = range(layout.part_count(spec))
            # a single part is written sooner than a worker has started
            where = in_process() if backend.is_here and len(parts) == 1 else backend
            written += where.run(partial(write_part, job), parts)
            open_job(job).inputs.require_same()
            _finish(store, configuration, folder)
    damaged = tuple(line for one in written for line in one.damaged)
    return Made(spec.frames, sum(one.rendered for one in written), damaged, configuration)


def _probe(spec: CorpusSpec, folder: Path, backend: Backend) -> tuple[str, str | None]:
    """Return which renderer draws all frames; workers on this machine have the same one."""
    if spec.renderer == "exact":
        return "exact", None
    where = in_process() if backend.is_here else backend
    found: tuple[str, str | None] = next(iter(where.run(partial(probe_renderer, spec_to_json(spec), str(folder)), [0])))
    return found


def probe_renderer(spec_json: str, folder: str, _: int) -> tuple[str, str | None]:
    """Return renderer and OpenGL's renderer string, found by drawing a tiny frame of the scene with most faces."""
    spec = spec_from_json(spec_json)
    plans = (plan_frame(spec, Path(folder), index) for index in first_frames(spec))
    plan = max(plans, key=lambda plan: count_faces(plan.scene))
    small = resized(plan.camera, _PROBE_PX / plan.camera.width)
    drawn = render(plan.scene, small, plan.world_from_camera, renderer=spec.renderer, bake=plan.bake)
    return drawn.renderer, drawn.gl_renderer


def _write_shards(
    store: Store, job: Job, spec: CorpusSpec, backend: Backend, on_frames: Callable[[int], None]
) -> Iterator[Written]:
    """Compare the finished shards with their sums, and write those that are missing or damaged."""
    done = {name for name in store.names("sums/") if name.startswith("sums/shard-")}
    shards = range(layout.shard_count(spec))
    finished = [shard for shard in shards if layout.shard_sums_name(shard) in done]
    missing = set(shards).difference(finished)
    on_frames(sum(len(layout.shard_frames(spec, shard)) for shard in finished))
    for written in backend.run(partial(write_shard, job), [*finished, *sorted(missing)]):
        if written.number in missing:
            on_frames(len(layout.shard_frames(spec, written.number)))
        yield written


def _finish(store: Store, configuration: Configuration, folder: Path) -> None:
    """Write calibrations and the manifest, which says that the corpus is complete."""
    for camera in corpus_cameras(configuration.spec, folder):
        write_file(store, layout.camera_name(camera.name), opencv_yaml(camera.camera, camera.name).encode())
    hashes = {name: store.sha256(name) for name in layout.manifest_files(configuration.spec)}
    write_file(store, layout.MANIFEST, to_json(manifest_values(configuration, hashes)))
