"""The power goes: a recorder's file that is cut at any byte gives back all its whole chunks."""

import numpy as np
import pytest
from mcap.reader import make_reader

from paint_deposition.errors import RecordingError
from paint_deposition.files.recordings import mcap_run
from paint_deposition.files.recordings.mcap_recovery import recover
from paint_deposition.files.recordings.mcap_run import RunTopic, RunWriter
from paint_deposition.files.recordings.message_definitions import standard

BOOL = 'std_msgs/msg/Bool'
MESSAGES = 300
CUTS = 40


@pytest.fixture(scope='module', params=['zstd', 'lz4', 'none'])
def run(request, tmp_path_factory):
    """A complete file of many small chunks, and where each ends: [(byte, messages up to it)]."""
    folder = tmp_path_factory.mktemp(request.param)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(mcap_run, 'CHUNK_BYTES', 1400)
        with RunWriter(folder / 'run', compression=request.param) as writer:
            writer.add_topic(RunTopic('/gun', BOOL, standard(BOOL)))
            for number in range(MESSAGES):
                cdr = b'\0\1\0\0' + bytes([number % 2])
                writer.write('/gun', cdr, (number + 1) * 1_000, number * 1_000)
    with writer.path.open('rb') as stream:
        chunks = make_reader(stream).get_summary().chunk_indexes
    ends, count = [(0, 0)], 0
    for chunk in chunks:
        # Times are 1000 ns apart.
        count += (chunk.message_end_time - chunk.message_start_time) // 1_000 + 1
        ends.append((chunk.chunk_start_offset + chunk.chunk_length, count))
    assert len(ends) > 8
    assert count == MESSAGES
    return writer.path.read_bytes(), ends


@pytest.mark.slow
def test_all_whole_chunks_come_back(run, tmp_path):
    content, ends = run
    rng = np.random.default_rng(7)
    borders = [end + step for end, _ in ends[1:] for step in (-1, 0, 1)]
    cuts = {*rng.integers(1, len(content), CUTS).tolist(), *borders}
    for cut in sorted(cuts):
        whole = max(count for end, count in ends if end <= cut)
        file = tmp_path / f'{cut}.mcap'
        file.write_bytes(content[:cut])
        try:
            recovered = recover(file, tmp_path / f'recovered_{cut}').message_count
        except RecordingError:
            recovered = 0
        assert recovered >= whole, f'cut at byte {cut} of {len(content)}'
        # No more either than there were, as far as the next chunk goes.
        following = next((count for end, count in ends if end > cut), MESSAGES)
        assert recovered <= following
