"""The harness: what is written, what is remembered, and what makes it run again."""

from dataclasses import replace
from io import StringIO

import pytest
from rich.console import Console
from typer.testing import CliRunner

import train.experiments.command as command
import train.run
from train.experiments.harness import reproduce as harness
from train.experiments.harness.experiment import Column, Experiment, Figure, Outcome, Table
from train.experiments.harness.laboratory import SMALL, Laboratory, code
from train.experiments.harness.page import markdown_page
from train.experiments.harness.reproduce import content_key, read_record, reproduce
from train.experiments.harness.style import panels
from train.experiments.registry import EXPERIMENTS

COLUMNS = (Column("name", "Name"), Column("value", "Value", "+.2f"), Column("paper", "Paper"))


def drawing():
    figure, (axes,) = panels(1, height=1.0)
    axes.plot([0, 1], [1, 0])
    return figure


@pytest.fixture
def runs():
    """A line for each run of the experiment."""
    return []


@pytest.fixture
def experiment(runs):
    def run(laboratory):
        runs.append(laboratory)
        rows = (("third | column", 1 / 3, None), ("negative", -2.0, "≈ π"))
        table = Table("counted", "Counted", COLUMNS, rows)
        return Outcome(
            (table,), (Figure("line", "A line.", drawing),), ("A note [with brackets].",)
        )

    return Experiment("counting", "Counting runs", "Here.", run, 1.0)


def laboratory(tmp_path, scale=SMALL, checkpoints=None, published=None):
    return Laboratory(scale, tmp_path / "networks", checkpoints, published)


def test_a_finished_experiment_is_run_again_where_anything_of_it_is_another(
    tmp_path, runs, experiment
):
    def run(scale=SMALL, **options):
        made = reproduce(experiment, laboratory(tmp_path, scale), tmp_path, **options)
        return made, len(runs)

    first, _ = run()
    assert run() == (first, 1)
    assert run(force=True)[1] == 2
    record = tmp_path / "cache" / "counting.json"
    for count, path in enumerate(("counted.csv", "figures/line.pdf"), start=3):
        (tmp_path / path).unlink()
        assert run()[1] == count
    record.write_text("{}")
    assert read_record(record) is None
    assert run()[1] == 5
    assert run(replace(SMALL, levels=3))[1] == 6


def test_code_and_weights_that_are_given_count_as_inputs(tmp_path, monkeypatch, experiment):
    needing = replace(experiment, needs_published=True)
    for given in ("checkpoints", "published"):
        folder = tmp_path / given
        folder.mkdir()
        keys = set()
        for content in (b"weights", b"other weights"):
            (folder / "paper.safetensors").write_bytes(content)
            keys.add(content_key(needing, laboratory(tmp_path, **{given: folder})))
        assert len(keys) == 2
    assert code() == code()
    monkeypatch.setattr(harness, "code", lambda: b"other code")
    assert content_key(needing, laboratory(tmp_path, published=folder)) not in keys


def test_an_experiment_that_breaks_off_leaves_no_record(tmp_path, experiment):
    def broken(_):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        reproduce(replace(experiment, run=broken), laboratory(tmp_path), tmp_path)
    assert not (tmp_path / "cache" / "counting.json").exists()
    assert not list(tmp_path.rglob("*.tmp"))


def test_tables_keep_every_digit_and_the_page_rounds(tmp_path, experiment):
    record = reproduce(experiment, laboratory(tmp_path), tmp_path)
    lines = (tmp_path / "counted.csv").read_text(encoding="utf-8").splitlines()
    assert lines == ["name,value,paper", f"third | column,{1 / 3!r},", "negative,-2.0,≈ π"]
    page = markdown_page({"counting": experiment}, {"counting": record})
    assert "| third \\| column | +0.33 | – " in page
    assert "| negative        | -2.00 | ≈ π   |" in page
    assert "![line](figures/line.png)" in page
    assert "A note [with brackets]." in page


def test_an_experiment_without_a_record_keeps_its_section_of_the_page(tmp_path, experiment):
    """A checkout has the page and no records: running one experiment lost all other sections."""
    record = reproduce(experiment, laboratory(tmp_path), tmp_path)
    others = [replace(experiment, name=name, title=name) for name in ("before", "after", "never")]
    ordered = [others[0], experiment, *others[1:]]
    known = {each.name: each for each in ordered}
    whole = markdown_page(known, {"before": record, "counting": record, "after": record})
    old = whole.replace("-2.00", "-1.00")
    page = markdown_page(known, {"counting": record}, old)
    titles = [line for line in page.splitlines() if line.startswith("## ")]
    assert titles == ["## before", "## Counting runs", "## after"]
    assert (page.count("-1.00"), page.count("-2.00")) == (2, 1)
    assert markdown_page(known, {}, whole) == whole


def test_figures_are_the_same_bytes_every_time(tmp_path, experiment):
    for side in "ab":
        reproduce(experiment, laboratory(tmp_path), tmp_path / side)
    for name, kind in (("line.png", b"\x89PNG"), ("line.pdf", b"%PDF")):
        here, there = ((tmp_path / side / "figures" / name).read_bytes() for side in "ab")
        assert here == there
        assert here.startswith(kind)


def invoke(*arguments):
    return CliRunner().invoke(train.run.app, ["reproduce", *map(str, arguments)])


def test_the_command_refuses_what_it_cannot_do(tmp_path, monkeypatch, runs, experiment):
    needing = replace(experiment, name="needing", needs_published=True)
    monkeypatch.setattr(command, "EXPERIMENTS", {"counting": experiment, "needing": needing})
    for arguments, named in (
        (["nothing"], "counting, needing"),
        (["needing"], "--published"),
        (["counting", "--checkpoints", tmp_path / "nowhere"], "--checkpoints"),
        (["counting", "--published", tmp_path / "nowhere"], "--published"),
    ):
        refused = invoke(*arguments, "--output", tmp_path)
        assert refused.exit_code == 2
        assert named in " ".join(refused.output.split())
    listed = invoke("--list")
    assert listed.exit_code == 0
    lines = listed.output.splitlines()
    assert [line.split()[0] for line in lines] == ["counting", "needing"]
    assert lines[1].endswith("needs --published DIR)")
    assert not runs


def test_what_an_experiment_cannot_use_is_told_and_ends_the_command(tmp_path, monkeypatch):
    folder = tmp_path / "empty"
    folder.mkdir()
    outcome = invoke("published", "--published", folder, "--output", tmp_path / "results")
    assert outcome.exit_code == 1
    assert "neither" in outcome.output


@pytest.mark.spawning
def test_experiments_that_run_at_once_find_the_same_and_write_the_page(tmp_path):
    """One trains a network."""
    chosen = [EXPERIMENTS[name] for name in ("saddle", "sphere-ridge")]
    pages = []
    for processes in (1, 2):
        output = tmp_path / str(processes)
        console = Console(file=StringIO())
        command.run_all(chosen, laboratory(output), output, console, processes, force=False)
        assert "saddle:" in console.file.getvalue()
        pages.append({path.name: path.read_bytes() for path in output.glob("*.*")})
    assert pages[0] == pages[1]
    assert {"saddle.csv", "sphere_ridge.csv", "README.md"} <= set(pages[0])
