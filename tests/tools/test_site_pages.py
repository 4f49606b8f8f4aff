"""The site's pages from elsewhere in the repository, and those that are made of the program."""

import importlib.util
import sys
from types import ModuleType

import pytest

from peakmark.cli.app import COMMANDS
from tests.places import ROOT


def tool(name: str) -> ModuleType:
    """Import a file of tools/site, which is no package."""
    spec = importlib.util.spec_from_file_location(f"site_{name}", ROOT / "tools" / "site" / f"{name}.py")
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
