"""`make prose`: count what makes our English hard to read, and fail where a count has grown.

Three things are counted, and docs/prose.json holds how many of each there may be:

    functions    docstrings of functions that do not open with a verb
    questions    docstrings of anything that open with What, Who, Whether, Where, Which or How
    sentences    sentences of more than 40 words in pages

    python docs/prose.py              # fails above a budget, and names the places
    python docs/prose.py --update     # writes the counts as the new budgets
"""

from __future__ import annotations

import ast
import json
import re
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
BUDGETS = Path(__file__).with_suffix(".json")
PACKAGES = ("addons", "benchmarks", "docs", "export", "pns_common", "service", "tests", "train")
PAGES = ("README.md", "CONTRIBUTING.md", "docs")
LONGEST = 40
QUESTIONS = frozenset({"what", "who", "whoever", "whose", "whether", "where", "which", "how"})
# Words that open no sentence in the imperative; ruff's D401 finds verbs in another form.
NO_VERBS = QUESTIONS | {"a", "an", "the", "this", "that", "these", "those", "it", "its", "one"}
NO_VERBS |= {"each", "every", "all", "any", "both", "no", "not", "of", "for", "in", "on", "at"}
NO_VERBS |= {"by", "from", "with", "without", "as", "if", "when", "while", "there", "same"}
# A test's name is its claim, and its docstring says more of it.
CLAIMS = "tests"

Found = tuple[str, str, str]


def main(arguments: list[str]) -> int:
    """Count, compare with the budgets or write them, and return the exit status."""
    found = [*docstrings(), *sentences()]
    counts = Counter(f"{kind} {where}" for kind, where, _ in found)
    if arguments == ["--update"]:
        BUDGETS.write_text(json.dumps(dict(sorted(counts.items())), indent=2) + "\n")
        return 0
    budgets = json.loads(BUDGETS.read_text())
    grown = {name for name, count in counts.items() if count > budgets.get(name, 0)}
    for kind, where, place in found:
        if f"{kind} {where}" in grown:
            print(f"{kind}: {place}")
    for name in sorted(grown):
        print(f"{name}: {counts[name]}, and {budgets.get(name, 0)} are allowed")
    if room := sorted(name for name in budgets if counts[name] < budgets[name]):
        print(f"fewer than allowed (python docs/prose.py --update): {', '.join(room)}")
    return 1 if grown else 0


def docstrings() -> Iterator[Found]:
    """Yield docstrings that open badly: the kind of fault, the package, and the place."""
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            for node in ast.walk(ast.parse(path.read_text())):
                line = getattr(node, "lineno", 1)
                place = f"{path.relative_to(ROOT)}:{line}"
                for kind in faults(node, package):
                    yield kind, package, place


def faults(node: ast.AST, package: str) -> Iterator[str]:
    """Yield the kinds of fault of one definition's docstring."""
    if not isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
        return
    text = ast.get_docstring(node)
    if not text:
        return
    word = re.split(r"\W", text, maxsplit=1)[0].lower()
    if word in QUESTIONS:
        yield "questions"
    is_function = isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
    if is_function and package != CLAIMS and word in NO_VERBS and not is_property(node):
        yield "functions"


def is_property(node: ast.FunctionDef | ast.AsyncFunctionDef) -> bool:
    """Return whether a function is read as an attribute: its docstring names the thing."""
    names = {ast.unparse(decorator).rpartition(".")[2] for decorator in node.decorator_list}
    return not names.isdisjoint({"property", "cached_property"})


def sentences() -> Iterator[Found]:
    """Yield sentences that are too long: the kind of fault, the page's group, and the place."""
    for group in PAGES:
        path = ROOT / group
        for page in sorted(path.rglob("*.md")) if path.is_dir() else [path]:
            for sentence in sentences_of(page.read_text()):
                words = len(sentence.split())
                if words > LONGEST:
                    place = f"{page.relative_to(ROOT)}: {words} words: {sentence[:60]}…"
                    yield "sentences", group, place


def sentences_of(text: str) -> Iterator[str]:
    """Yield the sentences of a Markdown page: of paragraphs, list items and cells of tables."""
    text = re.sub(r"^(```|~~~).*?^\1", "\n", text, flags=re.MULTILINE | re.DOTALL)
    text = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", text)
    # Blocks end at blank lines, items, headings and cells; indented lines are formulas.
    text = re.sub(r"^( {4,}.*|\s*\|[-| :]+\|)$", "\n", text, flags=re.MULTILINE)
    text = re.sub(r"^\s*([-*+]|\d+\.|#+|\|)\s", "\n\n", text, flags=re.MULTILINE)
    for block in re.split(r"\n\s*\n|\s\|(?=\s)", text):
        flat = " ".join(block.split())
        yield from re.split(r"(?<=[.!?])[\"”)*]*\s+(?=[A-Z`*(\"“0-9])", flat)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
