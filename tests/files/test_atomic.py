"""Files that appear whole or not at all: their rights, and what a power cut may leave."""

import os
import stat
from pathlib import Path

import pytest

from paint_deposition.files.atomic import write_text


def test_files_have_the_rights_of_the_process_and_its_umask_is_never_changed(
    tmp_path: Path, monkeypatch
):
    before = os.umask(0o027)
    # The mask belongs to the process: two threads that set it and put it back can leave it at 0.
    monkeypatch.setattr(os, 'umask', lambda mask: pytest.fail('the umask was changed'))
    write_text(tmp_path / 'film.csv', 'x_m,y_m')
    monkeypatch.undo()
    assert stat.S_IMODE((tmp_path / 'film.csv').stat().st_mode) == 0o640
    assert os.umask(before) == 0o027
