import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

import train.fitting.command
import train.run
from train.models.checkpoint import load_checkpoint
from train.models.recipes import paper

ROOT = Path(__file__).resolve().parents[2]


def quick_paper(seed=0):
    return replace(paper(seed), steps=2)


def test_no_command_trains_the_default_recipe(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(train.fitting.command, "RECIPES", {"paper": quick_paper})
    outcome = CliRunner().invoke(train.run.app, [], catch_exceptions=False)
    assert outcome.exit_code == 0
    for shown in ("2/2", "Distance RMSE", "Hausdorff", "Normal error", "95 % interval"):
        assert shown in outcome.output
    checkpoint = load_checkpoint(tmp_path / "build" / "checkpoints" / "paper.safetensors")
    assert checkpoint.recipe == quick_paper()
    assert set(checkpoint.metrics) == {"ridge-held-out"}


def test_fewer_steps_are_on_the_checkpoint(tmp_path):
    path = tmp_path / "short.safetensors"
    arguments = ["train", "--steps", "1", "--output", str(path)]
    assert CliRunner().invoke(train.run.app, arguments, catch_exceptions=False).exit_code == 0
    assert load_checkpoint(path).recipe == replace(paper(), steps=1)


@pytest.mark.parametrize(
    "arguments",
    [
        ["train", "--output"],
        ["certify", "--json"],
        ["reproduce", "headline", "--output"],
    ],
)
def test_what_cannot_be_written_is_told_before_the_work_begins(arguments, tmp_path, monkeypatch):
    monkeypatch.setattr(train.fitting.command, "fit", lambda *_: pytest.fail("it trains"))
    blocked = tmp_path / "file"
    blocked.write_text("no folder")
    outcome = CliRunner().invoke(
        train.run.app, [*arguments, str(blocked / "x")], catch_exceptions=False
    )
    assert outcome.exit_code != 0
    assert str(blocked / "x") in outcome.output
    assert "a folder that can be written" in outcome.output


# One process for both scripts: what takes long is what both import.
AS_SCRIPTS = """
import runpy, sys
from contextlib import suppress
for folder in ("train", "export"):
    sys.path[0], sys.argv = folder, ["run.py", "--help"]
    with suppress(SystemExit):
        runpy.run_path(f"{folder}/run.py", run_name="__main__")
"""


def test_scripts_run_from_the_repository_root():
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", AS_SCRIPTS],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("Usage") == 2
    # It is of a shell's commands, and these are none.
    assert "completion" not in done.stdout


def test_help_names_the_commands_and_waits_for_none_of_their_imports():
    code = "import sys; from train.run import app; app(standalone_mode=False); print(*sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", code, "--help"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    *text, modules = done.stdout.splitlines()
    for name in ("train", "reproduce", "certify", "validate"):
        assert any(line.split()[1:2] == [name] for line in text)
    assert {"torch", "numba", "trimesh"}.isdisjoint(modules.split())
