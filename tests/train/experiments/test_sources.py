from train.experiments.harness.sources import ROOT, code_of, sources_of


def names(module):
    return {str(path.relative_to(ROOT)) for path in sources_of(module)}


def test_sources_are_all_that_is_imported_at_any_depth():
    sources = names("train.experiments.paper.headline")
    assert {
        "train/experiments/paper/headline.py",
        "train/experiments/harness/comparison.py",
    } <= sources
    assert {
        "train/fitting/trainer.py",
        "train/surfaces/implicit.py",
        "pns_common/geometry/frames.py",
    } <= sources


def test_other_experiments_are_no_source_unless_they_are_imported():
    assert "train/experiments/paper/hero.py" not in names("train.experiments.paper.headline")
    assert "train/experiments/paper/ablation.py" in names("train.experiments.paper.published")


def test_modules_named_in_a_from_import_are_found():
    assert "train/experiments/paper/hero.py" in names("train.experiments.registry")


def test_other_packages_are_left_out():
    assert all(source.startswith(("train/", "pns_common/")) for source in names("train.run"))


def test_code_is_what_a_file_does_and_not_what_it_says(tmp_path):
    def code(text):
        path = tmp_path / f"{len(list(tmp_path.iterdir()))}.py"
        path.write_text(text)
        return code_of(path)

    plain = code("A = 1\ndef f(x):\n    return x + A\n")
    told = code(
        '"""What."""\nA = 1\n"""A."""\n\ndef f(x):  # why\n    """How."""\n    return (x + A)\n'
    )
    assert plain == told
    assert plain != code("A = 2\ndef f(x):\n    return x + A\n")
    assert plain != code("A = 1\ndef f(x):\n    return 'how'\n")
