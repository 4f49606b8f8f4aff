"""The gallery: each script of docs/gallery runs while the site is built, and becomes a page of code and pictures."""

import ast
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from repository_pages import ROOT

FOLDER = ROOT / "docs" / "gallery"
"""Scripts of some seconds each. Their docstring is a title and a text; they write pictures to the current folder."""

_HEAD = """# Gallery

Short scripts and what they draw. They ran when this site was built; copy one and change it.
"""


def gallery_pages(folder: Path = FOLDER) -> Iterator[tuple[str, str | bytes]]:
    """Yield each file's path in the site and its content: a page and its pictures a script, and the list of all.

    A script that fails stops the build with what it wrote to stderr.
    """
    items = []
    for script in sorted(folder.glob("*.py")):
        title, words = described(script)
        printed, pictures = run(script)
        yield f"gallery/{script.stem}.md", page(script, title, words, printed, list(pictures))
        for name, content in pictures.items():
            yield f"gallery/{name}", content
        items.append(
            f"## {title}\n\n[![{title}]({next(iter(pictures))})]({script.stem}.md)\n\n[The script]({script.stem}.md)"
        )
    yield "gallery/index.md", "\n\n".join([_HEAD, *items]) + "\n"


def described(script: Path) -> tuple[str, str]:
    """Return a script's title and text: the first line of its docstring, and the rest."""
    title, _, words = (ast.get_docstring(ast.parse(script.read_text(encoding="utf-8"))) or script.stem).partition("\n")
    return title.rstrip("."), words.strip()


def run(script: Path) -> tuple[str, dict[str, bytes]]:
    """Return what a script prints, and its pictures by name; a script without any is a ValueError."""
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run(
            [sys.executable, script], cwd=folder, capture_output=True, text=True, encoding="utf-8", timeout=120
        )
        pictures = {path.name: path.read_bytes() for path in sorted(Path(folder).glob("*.png"))}
    if done.returncode or not pictures:
        raise ValueError(f"{script.name}: expected a picture, got exit status {done.returncode}: {done.stderr[-2000:]}")
    return done.stdout.rstrip(), pictures


def page(script: Path, title: str, words: str, printed: str, pictures: list[str]) -> str:
    """Return a script's page."""
    code = script.read_text(encoding="utf-8").partition('"""\n\n')[2].rstrip()
    parts = [f"# {title}", words, *(f"![{title}]({name})" for name in pictures), f"```python\n{code}\n```"]
    parts += [f"It prints\n\n```text\n{printed}\n```"] if printed else []
    return "\n\n".join(parts) + "\n"
