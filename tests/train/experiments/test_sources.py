from train.experiments.sources import ROOT, sources_of


def names(module):
    return {str(path.relative_to(ROOT)) for path in sources_of(module)}


def test_sources_are_all_that_is_imported_at_any_depth():
    found = names("train.experiments.headline")
    assert {"train/experiments/headline.py", "train/experiments/comparison.py"} <= found
    assert {"train/trainer.py", "train/surfaces.py", "pns_common/frames.py"} <= found


def test_other_experiments_are_no_source_unless_they_are_imported():
    assert "train/experiments/hero.py" not in names("train.experiments.headline")
    assert "train/experiments/ablation.py" in names("train.experiments.published")


def test_modules_named_in_a_from_import_are_found():
    assert "train/experiments/hero.py" in names("train.experiments.registry")


def test_other_packages_are_left_out():
    assert all(one.startswith(("train/", "pns_common/")) for one in names("train.run"))
