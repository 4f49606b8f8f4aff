"""What MkDocs calls while it builds the site: it adds files of the repository, the commands, the API, the gallery."""

from collections.abc import Iterator
from typing import Any

from api_pages import api_pages
from command_pages import command_pages
from gallery_pages import gallery_pages
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page
from repository_pages import HOMES, ROOT, with_site_links


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages that do not lie in docs/, and name the pages of folders in the navigation."""
    for name, text in _generated():
        files.append(File.generated(config, name, content=text))
    names = [file.src_uri for file in files.documentation_pages()]
    config.nav = _with_folders(config.nav, names)
    return files


def on_page_markdown(markdown: str, page: Page, **_: Any) -> str:
    """Let links lead to where the site has what they name."""
    return with_site_links(markdown, page.file.src_uri)


def _generated() -> Iterator[tuple[str, str | bytes]]:
    for home, name in HOMES.items():
        yield name, (ROOT / home).read_text(encoding="utf-8")
    yield from command_pages()
    yield from api_pages()
    yield from gallery_pages()


def _with_folders(entry: Any, names: list[str]) -> Any:
    """Return an entry of the navigation in which "folder/" is the list of the pages in it, its index first."""
    if isinstance(entry, list):
        return [_with_folders(one, names) for one in entry]
    if isinstance(entry, dict):
        return {title: _with_folders(inner, names) for title, inner in entry.items()}
    if isinstance(entry, str) and entry.endswith("/"):
        inside = [name for name in names if name.startswith(entry)]
        return sorted(inside, key=lambda name: not name.endswith("/index.md"))
    return entry
