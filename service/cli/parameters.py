"""The parameters that commands share, and the `Options` that they give."""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable
from dataclasses import Field, fields
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar, get_type_hints

import typer
from typer.models import OptionInfo

from ..options import DESCRIPTIONS, EVERYDAY, FILES, MORE, PREFIX, RESEARCH, Limits, Options

Command = TypeVar("Command", bound=Callable[..., None])

# The groups of what is no field of `Options`; in each these come first.
_PANELS = {
    "output": EVERYDAY,
    **dict.fromkeys(("to", "read_as", "force", "report", "dry_run"), FILES),
    **dict.fromkeys(("engine", "address", "workers"), MORE),
}
_ORDER = (EVERYDAY, FILES, MORE, RESEARCH)


def takes_options(command: Command) -> Command:
    """Give a command a parameter for each field of `Options`; `options_of` reads them.

    They stand in place of its last parameter, which takes them by name.
    """
    own, hints = inspect.signature(command, eval_str=True), get_type_hints(Options)
    # Typer takes no union of two types.
    hints["reference_length"] = Any
    made = [
        inspect.Parameter(
            option.name,
            inspect.Parameter.KEYWORD_ONLY,
            default=option.default,
            annotation=Annotated[hints[option.name], _described(option)],
        )
        for option in fields(Options)
    ]
    before = [*own.parameters.values()][:-1]
    kept = [each.replace(kind=inspect.Parameter.KEYWORD_ONLY) for each in before]
    ordered = sorted([*kept, *made], key=_place)
    command.__signature__ = own.replace(parameters=ordered)  # type: ignore[attr-defined]
    return command


def _place(parameter: inspect.Parameter) -> int:
    """Return the place of an option's group in `--help`; arguments come first."""
    shown, *_ = getattr(parameter.annotation, "__metadata__", (None,))
    if not isinstance(shown, OptionInfo):
        return -1
    if shown.rich_help_panel is None:
        shown.rich_help_panel = _PANELS.get(parameter.name, RESEARCH)
    return _ORDER.index(shown.rich_help_panel)


def _described(option: Field[Any]) -> Any:
    flag = f"--{option.name.replace('_', '-')}"
    return typer.Option(
        f"{flag}/--no-{option.name}" if option.type == "bool" else flag,
        help=DESCRIPTIONS[option.name],
        metavar=option.metadata["metavar"],
        rich_help_panel=option.metadata["panel"],
        parser=_reference_length if option.name == "reference_length" else None,
    )


def options_of(context: typer.Context) -> Options:
    """Return what a command was given of the parameters that every way of refining shares.

    Raises:
        InvalidParameter: one is out of its range.
    """
    names = {field.name for field in fields(Options)}
    return Options(**{name: value for name, value in context.params.items() if name in names})


def local_path(text: str) -> Path:
    """Return the path of a file of this machine; a URL is none."""
    if "://" in text:
        raise typer.BadParameter(f"{text} is a URL: save the file first, or use pns batch")
    return Path(text)


def _reference_length(text: str) -> float | Literal["auto"]:
    if text == "auto":
        return "auto"
    try:
        return float(text)
    except ValueError as error:
        raise typer.BadParameter("it must be 'auto' or a number") from error


ModelOption = Annotated[
    str | None,
    typer.Option(
        metavar="NAME|FILE",
        help="a bundled model (see pns info), else a model file; ./NAME is always a file. "
        "Default: the default model",
    ),
]
EngineOption = Annotated[
    Literal["local", "ray"], typer.Option(help="processes of this machine, or a Ray cluster")
]
AddressOption = Annotated[
    str | None,
    typer.Option(help="a Ray cluster, or auto; implies --engine ray. Default: one started here"),
]
WorkersOption = Annotated[
    int | None, typer.Option(min=1, help="workers at a time; default: one for each processor")
]


def job_limits() -> Limits:
    """Return what one job may cost; settings, slow to load, are read where some are set."""
    if not any(name.upper().startswith(PREFIX) for name in os.environ):
        return Limits()
    from ..settings import Settings

    return Settings().job_limits()
