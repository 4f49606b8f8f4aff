"""The two kinds of work that make a corpus: rendering a shard of frames, and making the tables of a part.

Both are functions of plain strings and a number, so that any process anywhere can do them; both write their check
sums last, so that finished shards and parts can be told from unfinished ones.
"""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from threading import Lock

from peaksim.corpus import layout
from peaksim.corpus.configuration import Configuration, read_configuration, versions
from peaksim.corpus.inputs import Inputs
from peaksim.corpus.part import part_tables
from peaksim.corpus.plan import plan_frame
from peaksim.corpus.sample import Record, Sample, from_line, make_sample
from peaksim.corpus.shard import Shard, shard_in
from peaksim.corpus.spec import CorpusSpec
from peaksim.corpus.store.base import Store, Writing, write_file
from peaksim.corpus.store.opening import open_store
from peaksim.corpus.sums import Faults, lines_of, sealed_faults
from peaksim.errors import InputError, RendererError

_ONE_AT_A_TIME = Lock()  # a process has one GL context, which belongs to one thread at a time


@dataclass(frozen=True)
class Job:
    """Which corpus to work on."""

    dest: str
    """Its folder or URL; corpus.json is there."""
    folder: str
    """Where the specification's scenes and trajectories are."""
    configuration_sha256: str
    """Of its corpus.json."""


class Sums:
    """Writes files and collects their check sums, in the order of writing."""

    def __init__(self, store: Store) -> None:
        self.store = store
        self._lines: list[str] = []

    @contextmanager
    def create(self, name: str) -> Iterator[Writing]:
        """Yield a file to write, and note its check sum when it is finished."""
        with self.store.create(name) as file:
            yield file
        self.note(name, file.sha256)

    def write(self, name: str, content: bytes) -> None:
        """Write a whole file."""
        self.note(name, write_file(self.store, name, content))

    def note(self, name: str, digest: str) -> None:
        """Note a file that is already there."""
        self._lines.append(f"{digest}  {name}\n")

    def seal(self, name: str) -> None:
        """Write the sums as a file that `sha256sum --check` reads."""
        write_file(self.store, name, "".join(self._lines).encode())


@dataclass(frozen=True)
class OpenJob:
    """A job's corpus on this machine, opened once a process."""

    store: Store
    """Where it is written."""
    configuration: Configuration
    """Its corpus.json."""
    folder: Path
    """Where the specification's scenes and trajectories are."""
    inputs: Inputs
    """The files that it is made from, as they are here."""


@lru_cache(maxsize=4)
def open_job(job: Job) -> OpenJob:
    """Open a job's corpus.

    Raises
    ------
    InputError
        If this machine cannot read it, finds another one there, or has other versions or input files than those that
        make the bytes.
    """
    store = open_store(job.dest)
    if sha256(store.read(layout.CONFIGURATION)).hexdigest() != job.configuration_sha256:
        raise InputError(f"{job.dest}: expected the {layout.CONFIGURATION} of this run, found another one")
    configuration = read_configuration(store)
    here = versions(configuration.renderer, baked=True)
    for package, there in configuration.versions.items():
        if here.get(package) != there:
            raise InputError(
                f"{job.dest}: expected {package} {there}, which made it, got {here.get(package)} on this machine"
            )
    folder = Path(job.folder)
    inputs = Inputs(configuration.spec, folder, configuration.kinds, configuration.inputs)
    inputs.were_touched()
    return OpenJob(store, configuration, folder, inputs)


# --- shards -------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Written:
    """What became of a shard or part."""

    number: int
    """Its number."""
    rendered: int
    """Frames that were rendered now."""
    damaged: tuple[str, ...] = ()
    """What was wrong with the files of a finished one, which was then made again; one line a file."""


def write_shard(job: Job, shard: int) -> Written:
    """Render a shard's missing frames and write its files; those of a finished one are compared with its sums.

    Repeating it, also at the same time elsewhere, writes the same bytes.
    """
    with _ONE_AT_A_TIME:
        opened = open_job(job)
        faults = _faults(opened, layout.shard_sums_name(shard))
        if faults is not None and not faults:
            return Written(shard, 0)
        return Written(shard, _write_shard(opened, shard, frozenset(faults or ())), lines_of(faults or {}))


def _faults(job: OpenJob, sums_name: str) -> Faults | None:
    """Return what is wrong with a finished shard or part, None if it is not finished."""
    if not job.store.exists(sums_name):
        return None
    return sealed_faults(job.store, sums_name, layout.listed_in(job.configuration.spec, sums_name))


def _write_shard(job: OpenJob, shard: int, damaged: frozenset[str]) -> int:
    store, spec, rendered = job.store, job.configuration.spec, 0
    there = set(store.names(layout.frames_folder(shard))) - damaged if spec.store.files else set()
    sums = Sums(store)
    with ExitStack() as stack:
        archive: Shard | None = None
        if spec.store.shards:
            archive = stack.enter_context(shard_in(stack.enter_context(sums.create(layout.shard_name(shard)))))
        records = stack.enter_context(sums.create(layout.records_name(shard)))
        for index in layout.shard_frames(spec, shard):
            sample = read_finished(job, index, there)
            if sample is None:
                sample, rendered = _render(job, index), rendered + 1
                if spec.store.files:
                    _write_files(store, spec, index, sample)
            if spec.store.files:
                sums.note(layout.image_name(spec, index), sha256(sample.image).hexdigest())
                sums.note(layout.record_name(spec, index), sha256(sample.record).hexdigest())
            records.write(sample.record)
            if archive is not None:
                archive.add(f"{layout.frame_key(index)}.{layout.SUFFIXES[spec.pictures.format]}", sample.image)
                archive.add(f"{layout.frame_key(index)}.json", sample.record)
    if spec.store.files:
        store.settle(
            name
            for index in layout.shard_frames(spec, shard)
            for name in (layout.image_name(spec, index), layout.record_name(spec, index))
        )
    job.inputs.require_same()
    sums.seal(layout.shard_sums_name(shard))
    return rendered


def _render(job: OpenJob, index: int) -> Sample:
    """Return a frame; what it was planned from is compared after it was read, so that no other bytes are written."""
    configuration = job.configuration
    plan = plan_frame(configuration.spec, job.folder, index)
    if job.inputs.were_touched():
        plan = plan_frame(configuration.spec, job.folder, index)
    sample = make_sample(plan, configuration.renderer, configuration.spec.pictures)  # type: ignore[arg-type]
    gl_renderer = from_line(sample.record, layout.frame_key(index))["gl_renderer"]
    if gl_renderer != configuration.gl_renderer:
        raise RendererError(
            f"expected the OpenGL renderer {configuration.gl_renderer!r} that the corpus is made with, "
            f"got {gl_renderer!r} on this machine"
        )
    return sample


def _write_files(store: Store, spec: CorpusSpec, index: int, sample: Sample) -> None:
    """Write the image, then the record that vouches for it; files torn by a loss of power do not match."""
    write_file(store, layout.image_name(spec, index), sample.image, lasting=False)
    write_file(store, layout.record_name(spec, index), sample.record, lasting=False)


def read_finished(job: OpenJob, index: int, there: set[str]) -> Sample | None:
    """Return a frame that an earlier run has written, None if it is missing or damaged."""
    names = layout.image_name(job.configuration.spec, index), layout.record_name(job.configuration.spec, index)
    if not there.issuperset(names):
        return None
    sample = Sample(job.store.read(names[0]), job.store.read(names[1]))
    try:
        record = from_line(sample.record, names[1])
    except InputError:
        return None
    intact = sha256(sample.image).hexdigest() == record.get("picture_sha256") and sample.record.endswith(b"\n")
    return sample if intact else None


# --- parts --------------------------------------------------------------------------------------------------------


def write_part(job: Job, part: int) -> Written:
    """Write the tables of a part, whose shards are finished; those of a finished one are compared with its sums."""
    opened = open_job(job)
    store, configuration = opened.store, opened.configuration
    faults = _faults(opened, layout.part_sums_name(part))
    if faults is not None and not faults:
        return Written(part, 0)
    shards = layout.part_shards(configuration.spec, part)
    sums = Sums(store)
    with ExitStack() as stack:
        add = stack.enter_context(part_tables(configuration, lambda name: sums.create(layout.part_name(part, name))))
        for shard in shards:
            for record in read_records(store, shard):
                add(record)
    for shard in shards:
        name = layout.shard_sums_name(shard)
        sums.note(name, sha256(store.read(name)).hexdigest())
    opened.inputs.require_same()
    sums.seal(layout.part_sums_name(part))
    return Written(part, 0, lines_of(faults or {}))


def read_records(store: Store, shard: int) -> Iterator[Record]:
    """Yield the records of a shard's frames."""
    name = layout.records_name(shard)
    for line in store.read(name).splitlines(keepends=True):
        yield from_line(line, name)
