"""Where the report lives in a file: `asset.extras.pns`."""

from __future__ import annotations

from typing import Any

REPORT_KEY = "pns"
# glTF allows any JSON value as extras. One that is no object moves here, beside the report.
OLD_VALUE_KEY = "extras"


def replaces_extras(tree: dict[str, Any]) -> bool:
    """Return whether `asset.extras` holds a value that must move for the report to have a place."""
    return not isinstance(tree["asset"].get("extras", {}), dict)


def put_report(tree: dict[str, Any], report: dict[str, Any]) -> None:
    """Write the report into the tree; other keys of `asset.extras` stay."""
    asset = tree["asset"]
    if replaces_extras(tree):
        asset["extras"] = {OLD_VALUE_KEY: asset["extras"]}
    asset.setdefault("extras", {})[REPORT_KEY] = report
