"""The code that a result depends on: a module and all of ours that it imports, at any depth."""

import ast
from functools import cache
from pathlib import Path

import grimp

ROOT = Path(__file__).resolve().parents[3]
PACKAGES = ("pns_common", "train")


@cache
def sources_of(module: str) -> tuple[Path, ...]:
    """Return the files of a module and of all it imports from our packages, sorted."""
    modules = {module} | _graph().find_upstream_modules(module)
    return tuple(sorted(_file_of(name) for name in modules))


@cache
def _graph() -> grimp.ImportGraph:
    return grimp.build_graph(*PACKAGES, cache_dir=None)


@cache
def code_of(path: Path) -> bytes:
    """Return what a Python file does: neither comments nor docstrings nor its layout are in it."""
    tree = ast.parse(path.read_bytes())
    for node in ast.walk(tree):
        for name, value in ast.iter_fields(node):
            if isinstance(value, list):
                setattr(node, name, [part for part in value if not _says_only(part)])
    return ast.dump(tree).encode()


def _says_only(node: ast.AST) -> bool:
    """Return whether a statement is nothing but a text."""
    return (
        isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
    )


def _file_of(module: str) -> Path:
    stem = ROOT.joinpath(*module.split("."))
    return stem / "__init__.py" if stem.is_dir() else stem.with_suffix(".py")
