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


def test_content_and_name_are_on_disk_before_it_returns(tmp_path: Path, monkeypatch):
    calls = []
    sync, replace = os.fsync, os.replace

    def seen_sync(descriptor: int) -> None:
        place = os.readlink(f'/proc/self/fd/{descriptor}')
        calls.append('folder' if Path(place).is_dir() else Path(place).read_text())
        sync(descriptor)

    def seen_replace(source, target, **options) -> None:
        calls.append('renamed')
        replace(source, target, **options)

    monkeypatch.setattr(os, 'fsync', seen_sync)
    monkeypatch.setattr(os, 'replace', seen_replace)
    write_text(tmp_path / 'film.csv', 'x_m,y_m')
    assert calls == ['x_m,y_m', 'renamed', 'folder']
