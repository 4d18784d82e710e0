"""The laboratory's entry: `python train/run.py` trains the default recipe."""

import sys
from functools import partial
from pathlib import Path
from pkgutil import resolve_name

# Started as a file, Python looks for packages beside it and not in the checkout.
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import typer

# Where each stands, and what it does. To import one takes seconds: only that which is run is.
COMMANDS = {
    "train": (
        "train.fitting.command:train_command",
        "Train a recipe, write its checkpoint and print the held-out table.",
    ),
    "shapes": (
        "train.data.shape_library:shapes_command",
        "Fill a folder with the shapes that are trained and validated on, from a local copy.",
    ),
    "reproduce": (
        "train.experiments.command:reproduce_command",
        "Make the paper's tables and figures again.",
    ),
    "certify": (
        "train.certificates.command:certify_command",
        "Certify a model file, also one that someone else made; exit 1 if a certificate fails.",
    ),
    "validate": (
        "train.experiments.validation:validate_command",
        "Print the validation table of a model.",
    ),
}

# Completion would be for a command named run.py, which is not how this is started.
made = partial(typer.Typer, add_completion=False, pretty_exceptions_enable=False)
app = made(help="Train, measure and certify the operator.")


@app.callback(invoke_without_command=True)
def main(context: typer.Context) -> None:
    """Train the default recipe where no command is named."""
    if context.invoked_subcommand is None:
        run("train", context)


def run(name: str, context: typer.Context) -> None:
    """Import a command and run it with the arguments that are left."""
    alone = made()
    place, _ = COMMANDS[name]
    alone.command()(resolve_name(place))
    alone(context.args, prog_name=context.command_path)


def forwarded(context: typer.Context) -> None:
    """Run the command by whose name it was called."""
    run(context.info_name or "", context)


for name, (_, about) in COMMANDS.items():
    app.command(
        name,
        help=about,
        add_help_option=False,
        context_settings={"allow_extra_args": True, "ignore_unknown_options": True},
    )(forwarded)


if __name__ == "__main__":
    app()
