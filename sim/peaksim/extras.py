"""Which extra brings a library that is not installed: the core does without those that only some jobs need."""

EXTRAS = {
    **dict.fromkeys(("OpenGL", "av", "jinja2", "matplotlib", "mpl_toolkits", "pyarrow", "pyrender", "trimesh"), "sim"),
    **dict.fromkeys(("drjit", "mitsuba"), "traced"),
    **dict.fromkeys(("skimage", "sklearn"), "train"),
    **dict.fromkeys(("fsspec", "s3fs"), "cloud"),
    "distributed": "distributed",
    "evo": "evo",
    "pandas": "pandas",
    "pupil_apriltags": "compare",
    "pycolmap": "vlfeat",
    "rerun": "rerun",
}
"""Module → the extra of peakmark that brings it."""


def how_to_install(error: ImportError) -> str | None:
    """Return in one line what to install for an import that failed; None where no extra brings it.

    >>> how_to_install(ModuleNotFoundError("No module named 'av'", name="av.video"))
    "this needs av: pip install 'peakmark[sim]'"
    """
    library = (error.name or "").partition(".")[0]
    return f"this needs {library}: pip install 'peakmark[{EXTRAS[library]}]'" if library in EXTRAS else None
