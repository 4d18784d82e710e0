"""PYTHONOPTIMIZE strips asserts; nothing that a stranger meets may hang on one."""

import ast
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]


def test_the_service_asserts_nothing():
    for path in sorted((ROOT / "service").rglob("*.py")):
        nodes = ast.walk(ast.parse(path.read_text()))
        asserts = [node.lineno for node in nodes if isinstance(node, ast.Assert)]
        assert not asserts, f"{path}:{asserts}"
