"""Changed files of every kind are read, or refused in a line; `make fuzz` tries many more."""

import os
import zlib

import numpy as np
import pytest

from fuzz.targets import targets
from paint_deposition.errors import PaintError

INPUTS = int(os.environ.get('FUZZ_INPUTS', '40'))
SEED = int(os.environ.get('FUZZ_SEED', '1'))


def changed(data: bytes, words: list[bytes], rng: np.random.Generator) -> bytes:
    """The bytes after up to four changes: bits, cuts, doublings, words and numbers."""
    for _ in range(rng.integers(1, 5)):
        start = int(rng.integers(len(data) + 1))
        stop = start + int(rng.integers(1, 20))
        put = [
            bytes([rng.integers(256)]), b'', 2 * data[start:stop], rng.bytes(4),
            b'-1', b'1e309', b'99999999999', words[rng.integers(len(words))],
        ][rng.integers(8)]  # fmt: skip
        data = data[:start] + put + data[stop if rng.integers(2) else start + len(put) :]
    return data


@pytest.mark.slow
@pytest.mark.timeout(0 if INPUTS > 1000 else 300)
@pytest.mark.parametrize('name', targets())
def test_a_changed_file_is_read_or_refused_in_a_line(name, tmp_path):
    """The file of a finding stays in the folder of the test."""
    target, path = targets()[name], tmp_path / f'changed{targets()[name].suffix}'
    rng = np.random.default_rng([SEED, zlib.crc32(name.encode())])
    words = [word.encode() for word in target.words.split(' ')]
    for number in range(INPUTS):
        seed = target.seeds[number % len(target.seeds)]
        path.write_bytes(target.around(changed(seed, words, rng) if number > 2 else seed))
        line = 'read'
        try:
            target.read(path)
        except PaintError as refusal:
            line = str(refusal)
        assert line.strip()
        assert '\n' not in line
