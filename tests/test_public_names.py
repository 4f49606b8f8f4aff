"""Every public name, those on the pages of the API, says what it is: shapes, fields, and the errors that it raises."""

import ast
import inspect
import re
import textwrap
from collections.abc import Callable, Iterator
from importlib import import_module
from types import FunctionType
from typing import Any

import pytest

from tests.tools.test_site_pages import tool

MODULES = [name for modules, _ in tool("api_pages").PAGES.values() for name in modules.split()]


def public() -> dict[str, Any]:
    """Return dotted name → value of all functions and classes of the API, each once."""
    found = {}
    for module in map(import_module, MODULES):
        for name in tool("api_pages").public_names(module):
            value = getattr(module, name)
            if inspect.isclass(value) or isinstance(value, FunctionType):
                found.setdefault(value, f"{module.__name__}.{name}")
    return {name: value for value, name in found.items()}


def callables(name: str, value: Any) -> Iterator[tuple[str, Callable[..., Any]]]:
    """Yield a function, or a class's own public methods and properties."""
    if isinstance(value, FunctionType):
        yield name, value
        return
    for key, member in vars(value).items():
        if not key.startswith("_"):
            inner = member.fget if isinstance(member, property) else getattr(member, "__func__", member)
            if isinstance(inner, FunctionType) and inner.__module__ == value.__module__:
                yield f"{name}.{key}", inner


PUBLIC = public()
FUNCTIONS = dict(pair for name, value in PUBLIC.items() for pair in callables(name, value))
CLASSES = {name: value for name, value in PUBLIC.items() if inspect.isclass(value)}


def tree_of(value: Any) -> Any:
    return ast.parse(textwrap.dedent(inspect.getsource(value))).body[0]


def raised(function: Callable[..., Any]) -> set[str]:
    """Return the names of the errors that a function's own lines raise."""
    return {
        node.exc.func.id
        for node in ast.walk(tree_of(function))
        if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call) and isinstance(node.exc.func, ast.Name)
        if node.exc.func.id.endswith("Error")
    }


@pytest.mark.parametrize("name", [*FUNCTIONS, *CLASSES])
def test_it_says_what_it_is(name: str) -> None:
    assert len((inspect.getdoc(FUNCTIONS.get(name) or CLASSES[name]) or "").split()) > 1


@pytest.mark.parametrize("name", [name for name, function in FUNCTIONS.items() if raised(function)])
def test_it_names_the_errors_that_it_raises(name: str) -> None:
    text = inspect.getdoc(FUNCTIONS[name]) or ""
    assert {error for error in raised(FUNCTIONS[name]) if error not in text} == set()


@pytest.mark.parametrize(
    "name", [name for name, f in FUNCTIONS.items() if str(f.__annotations__.get("return")).startswith("numpy.ndarray")]
)
def test_arrays_that_it_returns_have_a_shape(name: str) -> None:
    assert re.search(r"\((\w+,|\.\.\.|…)", inspect.getdoc(FUNCTIONS[name]) or ""), inspect.getdoc(FUNCTIONS[name])


@pytest.mark.parametrize("name", [name for name, one in CLASSES.items() if hasattr(one, "__dataclass_fields__")])
def test_fields_are_documented_one_by_one_or_in_groups(name: str) -> None:
    body = tree_of(CLASSES[name]).body
    fields = [i for i, node in enumerate(body) if isinstance(node, ast.AnnAssign)]
    for i in fields:
        after = body[i + 1] if i + 1 < len(body) else None
        group_goes_on = isinstance(after, ast.AnnAssign)
        documented = isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant)
        assert group_goes_on or documented, f"{name}.{ast.unparse(body[i])}"
