"""`make prose` finds badly opened docstrings and long sentences, and fails."""

import importlib.util
from pathlib import Path

PATH = Path(__file__).resolve().parents[2] / "docs" / "prose.py"
spec = importlib.util.spec_from_file_location("prose", PATH)
assert spec is not None
assert spec.loader is not None
prose = importlib.util.module_from_spec(spec)
spec.loader.exec_module(prose)


def test_sentences_end_at_points_items_and_cells_and_code_has_none():
    page = (
        "# Heading\n\nOne two. Three [four](a.md) `x`!\n\n- item one\n- item two\n\n"
        "| a | b c |\n|---|---|\n| d | e |\n\n```sh\nno words here\n```\n"
    )
    found = [sentence.strip("| ") for sentence in prose.sentences_of(page)]
    assert [sentence for sentence in found if sentence] == [
        *("Heading", "One two.", "Three four `x`!", "item one", "item two"),
        *("a", "b c", "d", "e"),
    ]


def test_a_long_sentence_fails_and_its_place_is_named(tmp_path, monkeypatch, capsys):
    page = tmp_path / "docs" / "page.md"
    page.parent.mkdir()
    monkeypatch.setattr(prose, "ROOT", tmp_path)
    monkeypatch.setattr(prose, "PAGES", ("docs",))
    for words, status in ((41, 1), (40, 0)):
        page.write_text("word " * (words - 1) + "end.\n")
        assert prose.main() == status
    assert "docs/page.md: 4" in capsys.readouterr().out
