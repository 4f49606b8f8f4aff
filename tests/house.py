"""Reads how the files of both import roots depend on each other; `test_house.py` says what is allowed."""

import ast
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from pathlib import Path

Graph = Mapping[str, set[str]]
"""Dotted name of a file → the dotted names of the files that it imports, wherever in it the import stands."""


def files_of(*roots: Path) -> dict[str, Path]:
    """Return every Python file below import roots by its dotted name; a package stands for its `__init__`."""
    found = {}
    for root in roots:
        for path in sorted(root.rglob("*.py")):
            parts = path.relative_to(root).with_suffix("").parts
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


@cache
def parsed(path: Path) -> ast.Module:
    """Return a file's tree, which is read once."""
    return ast.parse(path.read_text(encoding="utf-8"))


@cache
def imported(path: Path, package: str) -> tuple[str, ...]:
    """Return the dotted names that a file imports, at its top or inside functions, not those for type checkers only."""
    return tuple(_imported(parsed(path), package))


def _imported(tree: ast.Module, package: str) -> Iterator[str]:
    for_types = {id(node) for block in ast.walk(tree) if _is_type_checking(block) for node in ast.walk(block)}
    for node in ast.walk(tree):
        if id(node) in for_types:
            continue
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            parents = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            base = ".".join([*parents, *([node.module] if node.module else [])])
            yield base
            yield from (f"{base}.{alias.name}" for alias in node.names)


def _is_type_checking(node: ast.AST) -> bool:
    return isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"


def graph_of(files: Mapping[str, Path]) -> dict[str, set[str]]:
    """Return which of the files each of them imports; `from package import module` means the module."""
    graph = {}
    for name, path in files.items():
        package = name if path.name == "__init__.py" else name.rpartition(".")[0]
        names = set(imported(path, package))
        packages = {n for n in names if any(other.startswith(f"{n}.") and other in files for other in names)}
        graph[name] = {n for n in names - packages if n in files and n != name}
    return graph


def circles(graph: Graph) -> list[list[str]]:
    """Return every set of two or more files that import each other, directly or by way of others (Tarjan, 1972)."""
    index: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    found: list[list[str]] = []

    def visit(name: str) -> None:
        index[name] = low[name] = len(index)
        stack.append(name)
        for other in sorted(graph.get(name, ())):
            if other not in index:
                visit(other)
                low[name] = min(low[name], low[other])
            elif other in stack:
                low[name] = min(low[name], index[other])
        if low[name] == index[name]:
            circle = stack[stack.index(name) :]
            del stack[stack.index(name) :]
            if len(circle) > 1:
                found.append(sorted(circle))

    for name in sorted(graph):
        if name not in index:
            visit(name)
    return found


def room_of(name: str, rooms: Iterable[str]) -> str | None:
    """Return the longest of the rooms that is the file or holds it."""
    holding = [room for room in rooms if name == room or name.startswith(f"{room}.")]
    return max(holding, key=len, default=None)


def upward(graph: Graph, floors: tuple[tuple[str, ...], ...]) -> list[str]:
    """Return a line for every import of a room on the same floor or above, and for every file without a room."""
    floor = {room: level for level, rooms in enumerate(floors) for room in rooms}
    lines = [f"{name}: stands on no floor" for name in sorted(graph) if room_of(name, floor) is None]
    for name in sorted(graph):
        own = room_of(name, floor)
        for other in sorted(graph[name]):
            theirs = room_of(other, floor)
            if own is not None and theirs is not None and own != theirs and floor[theirs] >= floor[own]:
                lines.append(f"{name} (floor {floor[own]}) imports {other} (floor {floor[theirs]})")
    return lines
