"""What GET /models answers: which models a request may name, and what each says of itself."""

from __future__ import annotations

import hashlib
import logging
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

from pydantic import BaseModel, Field, TypeAdapter

from ..errors import NoModelError
from .models import Models

if TYPE_CHECKING:
    from pns_common.schemes import Model

log = logging.getLogger("pns.service")


class ModelEntry(BaseModel):
    """A model: its file, and the card that is inside it."""

    name: str = Field(description="what `model=` takes")
    default: bool = Field(description="whether it is the one that runs without `model=`")
    hash: str = Field(description="sha256 of the file, as in reports")
    size: int | None = Field(description="the file's bytes; null for a model that has no file")
    format: int
    features: str = Field(description="feature set of edges", examples=["paper-5"])
    orientation: str = Field(examples=["symmetric"])
    budget: float = Field(description="C that it was trained at, and the default of `budget`")
    gate_sharpness: float = Field(description="c of the gate")
    vertex_features: str | None = Field(
        description="feature set of old vertices; null where Loop's rule places them"
    )
    vertex_gate_sharpness: float | None = Field(description="c of the old vertices' gate")
    learned_levels: int | None = Field(
        description="K: levels at which it acts, after which it is Loop; null: at all of them"
    )
    prior_strength: float | None = Field(description="s of the prior; null before format 3")
    network_scale: float | None = Field(
        description="the most that the network may ask for, in edge lengths; null before format 3"
    )
    fold_angle: float | None = Field(
        description="of the fold guard, in degrees; null before format 3"
    )
    boundary_strength: float | None = Field(
        description="b of the boundaries' own prior; null where they are Loop's"
    )
    side_gates: bool | None = Field(
        description="whether an edge's gate reads the sides of its two faces; null: the faces alone"
    )
    network_altitudes: float | None = Field(
        description="the longest that the network's unit may be, in altitudes of an edge's thinner "
        "face; null: edge lengths alone"
    )
    wide_bound: bool | None = Field(
        description="whether h of an edge's bound is the longest edge of both faces; null: its own"
    )
    crease_prior: bool | None = Field(
        description="whether the boundaries' prior acts at creases too; null: creases are Loop's"
    )
    tip_strength: float | None = Field(
        description="how much of Loop's own move is given back at tips; null: none"
    )
    even_prior_strength: float | None = Field(
        description="s of the prior where a mesh is even; null: `prior_strength` for any mesh"
    )
    crease_angle: float | None = Field(
        description="of the crease lines that `crease=auto` keeps, in degrees; null: none"
    )
    crease_levels: int | None = Field(
        description="at how many levels these lines are sharp; null: there are none"
    )
    edged_crease_angle: float | None = Field(
        description="of those of a mesh at least half of whose turns are that sharp, rows of like"
        " ones apart, and of those beside plane sides that were cut finely, in degrees; null: the"
        " same"
    )
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

    def is_known(self, if_none_match: str) -> bool:
        """Return whether a client that sends this If-None-Match has the content."""
        tags = {tag.strip().removeprefix("W/") for tag in if_none_match.split(",")}
        return bool(tags & {self.tag, "*"})


def catalogue_of(models: Models) -> Catalogue:
    """Read the catalogue, in a worker; a model that does not load has a name and no entry."""
    sources, served = models.sources, models.served
    entries: list[ModelEntry] = []
    # A served file may be called like a bundled model; it is none of the names then.
    for source in [*sources.values(), *([] if served in sources.values() else [served])]:
        try:
            model = models.load(source)
        except NoModelError as error:
            log.warning("%s", error)
        else:
            entries.append(_entry(model, default=source == served))
    entries.sort(key=lambda entry: (entry.name, entry.default))
    return Catalogue(tuple(sorted(sources)), _ENTRIES.dump_json(entries))


def _entry(model: Model, *, default: bool) -> ModelEntry:
    # A model that was given to the application need not come from a file.
    size = getattr(model, "size", None)
    card = asdict(model.card)
    return ModelEntry(name=model.name, default=default, hash=model.hash, size=size, **card)
