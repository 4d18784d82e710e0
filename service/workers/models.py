"""The models of a worker process, and the catalogue of them for GET /models."""

from __future__ import annotations

import hashlib
import logging
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import BaseModel, Field, TypeAdapter

from ..errors import NoModelError, check_choice

if TYPE_CHECKING:
    from pns_common.model.session import Model

log = logging.getLogger("pns.service")


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


class ModelEntry(BaseModel):
    """A model: its file, and the card that is inside it."""

    name: str = Field(description="what `model=` takes")
    default: bool = Field(description="whether it is the one that runs without `model=`")
    hash: str = Field(description="sha256 of the file, as in reports")
    size: int | None = Field(description="the file's bytes; null for a model that has no file")
    providers: list[str] | None = Field(
        description="what onnxruntime runs it on, preferred first; null without a file"
    )
    format: int
    features: str = Field(description="feature set of edges", examples=["paper-5"])
    orientation: str = Field(examples=["symmetric"])
    budget: float = Field(description="C that it was trained at, and the default of `budget`")
    gate_sharpness: float = Field(description="c of the gate")
    vertex_gate_sharpness: float | None = Field(description="c_v of the gate; null in format 1")
    base: str | None = Field(description="base scheme; null in format 1, which has Loop")
    boundary_strength: float | None = Field(
        description="strength of the prior along boundaries and creases; null in format 1"
    )
    network_scale: float | None = Field(
        description="τ, the longest vector of the network in edge lengths; null in format 1"
    )
    fold_angle: float | None = Field(
        description="θ of the fold guard, in degrees; null in format 1"
    )
    sharpness_levels: int | None = Field(
        description="at how many levels `crease=auto` keeps sharp edges; null in format 1"
    )
    width: int | None = Field(description="numbers in a state; null in format 1")
    hidden: int | None = Field(description="numbers of a round's hidden layer; null in format 1")
    rounds: int | None = Field(description="rounds of messages; null in format 1")
    training: dict[str, Any] = Field(description="recipe, seed, and what else fixes the training")
    metrics: dict[str, Any] = Field(description="measured on held-out data")


_ENTRIES = TypeAdapter(list[ModelEntry])


@dataclass(frozen=True)
class Catalogue:
    """The models of a service: the `names` that may be asked for, and the JSON `content`."""

    names: tuple[str, ...]
    content: bytes

    @cached_property
    def tag(self) -> str:
        """The ETag: same content, same tag."""
        return f'"{hashlib.sha256(self.content).hexdigest()[:32]}"'


def catalogue_of(models: Models) -> Catalogue:
    """Read the catalogue, in a worker; a model that does not load has a name and no entry."""
    from pns_common.model.file import COMPANIONS

    sources, served = models.sources, models.served
    entries: list[ModelEntry] = []
    # A served file may be called like a bundled model; it is none of the names then.
    for source in [*sources.values(), *([] if served in sources.values() else [served])]:
        try:
            model = models.load(source)
        except NoModelError as error:
            log.warning("%s", error)
        else:
            # One that was given to the application need not come from a file.
            size, providers = getattr(model, "size", None), getattr(model, "providers", None)
            named = {"name": model.name, "hash": model.hash, "size": size, "providers": providers}
            entries.append(ModelEntry(default=source == served, **named, **asdict(model.card)))
            of_polygons = entries[-1].base == "catmull-clark" or model.name in COMPANIONS
            if source == served and not of_polygons:
                log.warning(
                    "model %s has no companion for polygons: Catmull-Clark refines them without it",
                    model.name,
                )
    entries.sort(key=lambda entry: (entry.name, entry.default))
    return Catalogue(tuple(sorted(sources)), _ENTRIES.dump_json(entries))
