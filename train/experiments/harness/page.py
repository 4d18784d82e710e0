"""One Markdown page of all that was found."""

from collections.abc import Mapping
from io import StringIO

from rich import box
from rich.console import Console
from rich.table import Table as RichTable

from train.experiments.harness.experiment import Experiment, Table
from train.experiments.harness.reproduce import Record, formatted

INTRODUCTION = """\
# Results

Made by `python train/run.py reproduce --published DIR`; every number under our own headings was
computed by that command. The author's published data are not kept with the source; without them the
last section is left out. What the default model reaches stands on [its page](validation.md).
Columns headed *Paper* are printed in the paper, columns headed *Published* in the files of its
author's repository; they stand there for comparison and are no measurement of ours.
Improvements are relative to Loop, in per cent: the mean over 2000 paired bootstrap resamples.
Lengths are in the patches' own unit (they span [−1, 1]²), angles in radians. The proximity ratio is
‖q − q0‖ / (C h²), with C = 0.5 where a method has no budget of its own.
The command writes each table as a CSV file with all digits beside this page, each figure as a PNG
and a PDF. CSV files, which long tables are in alone, and PDFs are not kept with the source.
"""


# Rows of the longest table that the page shows; of longer ones it names the file.
LONGEST = 90


def markdown_page(
    experiments: Mapping[str, Experiment], records: Mapping[str, Record], before: str = ""
) -> str:
    """Return the page of all experiments, in their order.

    One without a record keeps its section of the page as it was before: a checkout has the page and
    no records, and running one experiment there is not to lose the others.
    """
    kept = _sections(before)
    parts = [INTRODUCTION]
    for name, experiment in experiments.items():
        if name in records:
            parts.append(_section(experiment, records[name]))
        elif experiment.title in kept:
            parts.append(kept[experiment.title])
    return "\n".join(parts)


def _sections(page: str) -> dict[str, str]:
    """Return the sections of a page by their titles."""
    _, *sections = page.split("\n## ")
    return {text.partition("\n")[0]: f"## {text.rstrip()}\n" for text in sections}


def _section(experiment: Experiment, record: Record) -> str:
    lines = [f"## {experiment.title}", "", f"`{experiment.name}`. {experiment.source}", ""]
    if record.scale != "full":
        lines += [f"*Scale {record.scale}: a trial run, no number here means anything.*", ""]
    for table in record.tables:
        lines += [f"**{table.title}** ([CSV]({table.name}.csv))", ""]
        if len(table.rows) <= LONGEST:
            lines += [_table(table), ""]
        else:
            lines += [f"{len(table.rows)} rows, in the CSV file.", ""]
    for figure in record.figures:
        lines += [f"![{figure.name}](figures/{figure.name}.png)", "", f"*{figure.caption}*", ""]
    for note in record.notes:
        lines += [note, ""]
    return "\n".join(lines)


def _table(table: Table) -> str:
    """Return a Markdown table; columns that hold nothing are left out."""
    shown = [i for i in range(len(table.columns)) if any(r[i] is not None for r in table.rows)]
    rich = RichTable(box=box.MARKDOWN)
    for index in shown:
        numeric = any(isinstance(row[index], int | float) for row in table.rows)
        rich.add_column(table.columns[index].heading, justify="right" if numeric else "left")
    for row in table.rows:
        cells = (formatted(row[index], table.columns[index]) for index in shown)
        rich.add_row(*(cell.replace("|", "\\|") for cell in cells))
    text = StringIO()
    # Wide enough that nothing is wrapped; no markup, so that brackets stay.
    Console(file=text, width=1000, markup=False, emoji=False, highlight=False).print(rich)
    return "\n".join(line.rstrip() for line in text.getvalue().splitlines() if line.strip())
