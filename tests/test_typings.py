"""The stubs of typings/ say nothing of a library that the library does not have."""

import ast
import inspect
from pathlib import Path

import pytest

STUBS = Path(__file__).resolve().parents[1] / "typings"


def promised():
    """Each function of a stub: module, path of names, names of its parameters."""
    for path in sorted(STUBS.rglob("*.pyi")):
        module = ".".join(path.relative_to(STUBS).with_suffix("").parts).removesuffix(".__init__")
        for node in ast.parse(path.read_text()).body:
            inner = node.body if isinstance(node, ast.ClassDef) else []
            for owner, each in [([], node), *(([node.name], each) for each in inner)]:
                if isinstance(each, ast.FunctionDef):
                    arguments = [*each.args.posonlyargs, *each.args.args, *each.args.kwonlyargs]
                    names = [argument.arg for argument in arguments if argument.arg != "cls"]
                    yield pytest.param(module, [*owner, each.name], names, id=each.name)


@pytest.mark.parametrize(("module", "path", "parameters"), list(promised()))
def test_a_stub_promises_what_there_is(module, path, parameters):
    value = pytest.importorskip(module)
    for name in path:
        value = getattr(value, name)
    real = inspect.signature(value).parameters
    takes_any = any(each.kind is each.VAR_KEYWORD for each in real.values())
    assert [name for name in parameters if name not in real and not takes_any] == []
