"""The site's pages from elsewhere in the repository, and those that are made of the program."""

import importlib.util
import re
import sys
from pathlib import Path
from types import ModuleType

import pytest

from peakmark.cli.app import COMMANDS
from tests.places import ROOT

SITE = ROOT / "tools" / "site"
GALLERY = ROOT / "docs" / "gallery"


def tool(name: str) -> ModuleType:
    """Import a file of tools/site, which is no package; its files import each other by name."""
    if str(SITE) not in sys.path:
        sys.path.append(str(SITE))
    spec = importlib.util.spec_from_file_location(f"site_{name}", SITE / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize(
    ("page", "text", "expected"),
    [
        ("figures/floor.md", "[a](../images/x.png)", "[a](../images/x.png)"),
        ("figures/driving.md", "[a](../../scenes/README.md#camera)", "[a](../reference/scene-files.md#camera)"),
        ("reference/scene-files.md", "[a](../CORPUS.md)", "[a](corpus-format.md)"),
        ("project/contributing.md", "[a](CONVENTIONS.md), [b](LICENSE)", "[a](../understand/conventions.md), b"),
        (
            "index.md",
            "`[a](../CORPUS.md)` [b](https://x.example/a.md)",
            "`[a](../CORPUS.md)` [b](https://x.example/a.md)",
        ),
    ],
)
def test_links_lead_to_the_pages_of_the_site(page: str, text: str, expected: str) -> None:
    assert tool("repository_pages").with_site_links(text, page) == expected


def test_every_command_has_a_page_with_all_its_options() -> None:
    pages = dict(tool("command_pages").command_pages())
    assert {f"reference/commands/{name}.md" for name in COMMANDS} < set(pages)
    assert "| `--side-m` float | Printed side" in pages["reference/commands/envelope.md"]
    assert "*default: 0.08*" in pages["reference/commands/envelope.md"]
    assert "## peakmark regress compare" in pages["reference/commands/regress.md"]
    assert "| `--baseline` path | The accepted" in pages["reference/commands/regress.md"]


def test_every_public_name_of_both_packages_is_on_a_page() -> None:
    import peaksim

    import peakmark

    text = "\n".join(text for _, text in tool("api_pages").api_pages())
    for package in (peakmark, peaksim):
        for name in package.__all__:
            if name not in ("__version__", "marker", "surf"):  # two are modules, with pages of their own
                assert f"::: {package.__name__}.{name}\n" in text


SCRIPT = '"""A dot.\n\nIt is black.\n"""\n\nprint("drawn")\nopen("dot.png", "wb").write(b"PNG")\n'


def test_a_script_of_the_gallery_becomes_a_page_with_its_picture_its_code_and_what_it_prints(tmp_path: Path) -> None:
    (tmp_path / "dot.py").write_text(SCRIPT, "utf-8")
    pages = dict(tool("gallery_pages").gallery_pages(tmp_path))
    assert pages["gallery/dot.png"] == b"PNG"
    code = SCRIPT.partition('"""\n\n')[2].rstrip()
    texts = [
        "# A dot",
        "It is black.",
        "![A dot](dot.png)",
        f"```python\n{code}\n```",
        "It prints",
        "```text\ndrawn\n```",
    ]
    assert pages["gallery/dot.md"] == "\n\n".join(texts) + "\n"
    assert "## A dot\n\n[![A dot](dot.png)](dot.md)" in pages["gallery/index.md"]


@pytest.mark.parametrize("code", ["raise SystemExit(3)", "print(1)"])
def test_a_script_that_fails_or_draws_nothing_stops_the_build(code: str, tmp_path: Path) -> None:
    (tmp_path / "bad.py").write_text(code, "utf-8")
    with pytest.raises(ValueError, match=r"bad\.py: expected a picture, got exit status [03]"):
        list(tool("gallery_pages").gallery_pages(tmp_path))


@pytest.mark.slow
@pytest.mark.parametrize("script", sorted(GALLERY.glob("*.py")), ids=lambda path: path.stem)
def test_every_script_of_the_gallery_runs_and_says_what_it_shows(script: Path) -> None:
    title, words = tool("gallery_pages").described(script)
    assert title
    assert words
    printed, pictures = tool("gallery_pages").run(script)
    assert list(pictures) == [f"{script.stem}.png"]
    expected = {
        "camera_pose": r"off by 0\.\d\d mm",
        "curled_sheet": r"(sheet \d: off by 0\.\d+ px\n?){3}",
        "floor": r"8 markers found; 6 are",
        "patterns": r"(\S+\n?){8}",
        "posters": r"poster 3 .*\nposter 5 ",
        "sensors": r"(\S+: [4-9] markers\n?){4}",
    }[script.stem]
    assert re.match(expected, printed)
