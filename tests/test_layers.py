"""No arrow points back: rooms import only from those below them."""

from importlinter.cli import lint_imports


def test_rooms_import_only_from_below(repository, monkeypatch):
    monkeypatch.syspath_prepend(str(repository / 'ros2_ws/src/paint_deposition'))
    assert lint_imports(config_filename=str(repository / 'pyproject.toml'), no_cache=True) == 0
