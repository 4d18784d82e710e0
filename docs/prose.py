"""`make prose`: find what makes our English hard to read, and fail where there is some.

functions    docstrings of functions that do not open with a verb
questions    docstrings of anything that open with What, Who, Whether, Where, Which or How
sentences    sentences of more than 40 words in pages
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
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

# A kind of fault, and its place.
Found = tuple[str, str]


def main() -> int:
    """Print what is found, and return the exit status."""
    found = [*docstrings(), *sentences()]
    for kind, place in found:
        print(f"{kind}: {place}")
    return 1 if found else 0


def docstrings() -> Iterator[Found]:
    """Yield docstrings that open badly."""
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            for node in ast.walk(ast.parse(path.read_text())):
                line = getattr(node, "lineno", 1)
                place = f"{path.relative_to(ROOT)}:{line}"
                for kind in faults(node, package):
                    yield kind, place


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
    """Yield sentences that are too long."""
    for group in PAGES:
        path = ROOT / group
        for page in sorted(path.rglob("*.md")) if path.is_dir() else [path]:
            for sentence in sentences_of(page.read_text()):
                words = len(sentence.split())
                if words > LONGEST:
                    place = f"{page.relative_to(ROOT)}: {words} words: {sentence[:60]}…"
                    yield "sentences", place


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
    sys.exit(main())
