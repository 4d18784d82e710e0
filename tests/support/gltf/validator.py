"""Khronos's glTF validator, run by node."""

from tests.support import node_tools


def errors(paths):
    """For each file the validator's error codes, sorted; skips the test where node is absent."""
    messages = node_tools.run("validate.mjs", paths)
    return [
        sorted({m["code"] for m in messages[str(path)] if m["severity"] == 0}) for path in paths
    ]
