"""The models of a worker process: the one that is served, and the bundled ones."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import NoModelError, check_choice

if TYPE_CHECKING:
    from pns_common.model.session import Model


class Models:
    """Each is loaded when it is first asked for, and kept: there are no others to ask for.

    A model may weigh megabytes and take long to build: requests carry names. The served one is
    handed over once, when the process starts.
    """

    def __init__(self) -> None:
        self._source: Model | str | None = None
        self._providers: Sequence[str] | None = None
        self._loaded: dict[str, Model] = {}

    def hold(self, source: Model | str | None, providers: Sequence[str] | None = None) -> None:
        """Serve a model, or the name or file of one; None stands for the default one.

        ``providers`` of onnxruntime run every model that is loaded here; None: the processor.
        """
        self._source, self._providers = source, providers

    @property
    def served(self) -> Model | str:
        """The model that a request without a name gets, or its name or file."""
        from pns_common.model.file import DEFAULT_MODEL

        return DEFAULT_MODEL if self._source is None else self._source

    @property
    def sources(self) -> dict[str, Model | str]:
        """Source of each name; a bundled name wins over that of a served file."""
        from pns_common.model.file import bundled_models

        served, names = self.served, bundled_models()
        if not isinstance(served, str):
            name = served.name
        else:
            name = served if served in names else Path(served).stem
        return {name: served} | {bundled: bundled for bundled in names}

    def get(self, name: str | None = None) -> Model:
        """Return the model of that name, or the served one.

        Raises:
            InvalidParameter: there is none of that name.
            NoModelError: it does not load.
        """
        if name is None:
            return self.load(self.served)
        sources = self.sources
        check_choice("model", name, sorted(sources))
        return self.load(sources[name])

    def load(self, source: Model | str) -> Model:
        """Load a model where it has not been yet. Raises NoModelError."""
        from pns_common import ModelError, ParameterError, load_model
        from pns_common.model.session import CPU

        if not isinstance(source, str):
            return source
        if source not in self._loaded:
            try:
                self._loaded[source] = load_model(source, self._providers or CPU)
            except (ModelError, ParameterError) as error:
                raise NoModelError(str(error)) from error
        return self._loaded[source]
