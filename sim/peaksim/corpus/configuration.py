"""Everything that decides the bytes of a corpus: corpus.json, compared before anything is written."""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from peaksim.corpus.inputs import hash_file, input_files
from peaksim.corpus.layout import CONFIGURATION, FORMAT
from peaksim.corpus.plan import read_scene
from peaksim.corpus.spec import CorpusSpec, spec_to_json
from peaksim.corpus.store.base import Store
from peaksim.corpus.vary import all_markers, poster_kinds
from peaksim.errors import InputError
from peaksim.scene.schema import AreaLightTable, EnvironmentTable, SceneTable

_LARGEST_FILE = 1 << 26  # bytes of corpus.json; a specification has at most a million

_TRACING = ("mitsuba", "drjit")
_PACKAGES = (
    "peakmark",
    "numpy",
    "scipy",
    "opencv-contrib-python-headless",
    "pillow",
    "pyarrow",
    "PyOpenGL",
    "scikit-robot-pyrender",
    "trimesh",
)


@dataclass(frozen=True)
class Configuration:
    """corpus.json."""

    spec: CorpusSpec
    """The specification, defaults included."""
    renderer: str
    """"exact" or "gl": what "auto" resolved to."""
    gl_renderer: str | None
    """OpenGL's renderer string, None without GL."""
    kinds: tuple[str, ...]
    """Every kind of marker that can come, sorted."""
    inputs: dict[str, str]
    """Scene, texture, marker and trajectory files, named from the specification's folder or as shipped → SHA-256."""
    versions: dict[str, str]
    """Package → version."""

    def to_bytes(self) -> bytes:
        """Return the file's content."""
        values = {
            "format": FORMAT,
            "spec": json.loads(spec_to_json(self.spec)),
            "renderer": self.renderer,
            "gl_renderer": self.gl_renderer,
            "kinds": list(self.kinds),
            "inputs": self.inputs,
            "versions": self.versions,
        }
        return to_json(values)


_FILE = TypeAdapter(Configuration)


def make_configuration(spec: CorpusSpec, folder: Path, renderer: str, gl_renderer: str | None) -> Configuration:
    """Return the configuration of a new corpus; `folder` is where the specification's files are."""
    scenes = [read_scene(choice.file, folder) for choice in spec.scenes]
    single = {kind for table, _ in scenes for kind in (spec.markers.kinds or [m.kind for m in all_markers(table)])}
    warped = () if spec.warped is None else spec.warped.kinds
    kinds = tuple(sorted(single.union(warped, *(poster_kinds(table) for table, _ in scenes))))
    inputs = {name: hash_file(file) for name, file in input_files(spec, folder, kinds).items()}
    tables = [table for table, _ in scenes]
    return Configuration(spec, renderer, gl_renderer, kinds, inputs, versions(renderer, is_baked(spec, tables)))


def is_baked(spec: CorpusSpec, scenes: list[SceneTable]) -> bool:
    """Return whether a corpus shows lamps, windows or skies, whose light Mitsuba bakes where it does not trace it."""
    if spec.bake is False:
        return False
    if spec.light is not None:
        return spec.light.has_lamps
    return any(isinstance(light, AreaLightTable | EnvironmentTable) for table in scenes for light in table.lights)


def versions(renderer: str, baked: bool = False) -> dict[str, str]:
    """Return the versions of the packages that make the bytes of a renderer; one that is missing is left out."""
    found = {}
    for package in (*_PACKAGES, *(_TRACING if renderer == "traced" or baked else ())):
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    return found


def read_configuration(store: Store) -> Configuration:
    """Read a corpus's configuration.

    Raises
    ------
    InputError
        If there is none, or it is of another format.
    """
    content, where = store.read(CONFIGURATION, _LARGEST_FILE), f"{store.url}: {CONFIGURATION}"
    try:
        if (format := json.loads(content)["format"]) != FORMAT:
            raise InputError(f"{where}: expected format {FORMAT!r}, got {format!r:.60}")
        return _FILE.validate_json(content)
    except ValidationError as error:
        fault = error.errors(include_url=False)[0]
        field = ".".join(map(str, fault["loc"]))
        raise InputError(f"{where}: expected the configuration of a corpus: {field!r:.80}: {fault['msg']}") from error
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{where}: expected the configuration of a corpus: {error!r:.80}") from error


def manifest_values(configuration: Configuration, hashes: dict[str, str]) -> dict[str, Any]:
    """Return what the manifest states: everything but the hashes is as in the configuration."""
    spec = configuration.spec
    return {
        "format": FORMAT,
        "name": spec.name,
        "frames": spec.frames,
        "seed": spec.seed,
        "renderer": configuration.renderer,
        "gl_renderer": configuration.gl_renderer,
        "versions": configuration.versions,
        "sha256": hashes,
    }


def to_json(values: dict[str, Any]) -> bytes:
    """Return the content of corpus.json or of the manifest."""
    return (json.dumps(values, indent=2, ensure_ascii=False) + "\n").encode()


def claim_store(store: Store, configuration: Configuration) -> None:
    """Claim a folder or bucket for this corpus, or find that it already is this corpus.

    Raises
    ------
    InputError
        If it holds another corpus (with the first field that differs), or other files.
    """
    if store.exists(CONFIGURATION):
        _refuse_difference(store, configuration)
        return
    foreign = next(iter(store.names()), None)
    if foreign is not None:
        raise InputError(f"{store.url}: expected an empty folder or a corpus, found {foreign!r}")
    with store.create(CONFIGURATION) as file:
        file.write(configuration.to_bytes())


def _refuse_difference(store: Store, configuration: Configuration) -> None:
    there = dict(_flat(json.loads(read_configuration(store).to_bytes())))
    here = dict(_flat(json.loads(configuration.to_bytes())))
    for field in [*here, *(field for field in there if field not in here)]:
        if there.get(field) != here.get(field):
            raise InputError(
                f"{store.url}: holds a corpus of another configuration: {field} is "
                f"{there.get(field)!r} there and {here.get(field)!r} here"
            )


def _flat(value: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    """Yield (dotted name, plain value) of nested dicts and lists."""
    if isinstance(value, dict | list):
        items = value.items() if isinstance(value, dict) else enumerate(value)
        for key, inner in items:
            yield from _flat(inner, f"{name}.{key}".lstrip("."))
    else:
        yield name, value
