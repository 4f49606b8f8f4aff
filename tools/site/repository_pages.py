"""Pages of the site that lie elsewhere in the repository, where the code's tests and its web pages read them."""

import posixpath
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

HOMES = {
    "CONVENTIONS.md": "understand/conventions.md",
    "CORPUS.md": "reference/corpus-format.md",
    "scenes/README.md": "reference/scene-files.md",
    "assets/README.md": "reference/assets.md",
    "benchmarks/README.md": "figures/speed.md",
    "CONTRIBUTING.md": "project/contributing.md",
    "CHANGELOG.md": "project/changes.md",
}
"""File of the repository → page of the site."""

_LINK = re.compile(r"(!?)\[((?:[^][]|\[[^][]*\])*)\]\(([^)#\s:]+)(#[^)\s]*)?\)")
_CODE = re.compile(r"^```.*?^```$|`[^`\n]+`", flags=re.DOTALL | re.MULTILINE)


def with_site_links(markdown: str, page: str) -> str:
    """Return a page's text with links to files of the repository led to the site's pages.

    Parameters
    ----------
    markdown
        The text; links are relative to where the file lies in the repository. Examples are left as they are.
    page
        The page's path in the site, such as "figures/speed.md".

    A link to a file that the site does not have becomes its words alone.
    """
    homes = {name: home for home, name in HOMES.items()}
    folder = posixpath.dirname(homes.get(page, f"docs/{page}"))

    def replaced(match: re.Match[str]) -> str:
        target = posixpath.normpath(posixpath.join(folder, match[3]))
        name = HOMES.get(target) or (target.removeprefix("docs/") if target.startswith("docs/") else None)
        if name is None:
            return match[2] if (ROOT / target).exists() else match[0]
        link = posixpath.relpath(name, posixpath.dirname(page) or ".")
        return f"{match[1]}[{match[2]}]({link}{match[4] or ''})"

    parts, start = [], 0
    for code in _CODE.finditer(markdown):
        parts += [_LINK.sub(replaced, markdown[start : code.start()]), code[0]]
        start = code.end()
    return "".join([*parts, _LINK.sub(replaced, markdown[start:])])
