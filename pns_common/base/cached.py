"""A property that is computed once: functools' own, as it is from Python 3.12 on.

Before, it holds one lock for all instances of a class while it computes: threads that refine meshes
of their own waited for each other, and a process that was forked meanwhile waited for ever.
"""

from __future__ import annotations

import functools
from typing import Any, TypeVar

T = TypeVar("T")


class cached_property(functools.cached_property[T]):  # noqa: N801
    """A property that is computed when it is first asked for; where two ask at once, by both."""

    def __get__(self, instance: Any, owner: type[Any] | None = None) -> Any:
        """Return the value, which is found at the instance itself from then on."""
        if instance is None:
            return self
        made = self.func(instance)
        instance.__dict__[self.attrname] = made
        return made
