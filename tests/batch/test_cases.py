"""The same content has the same bytes, however it came into memory."""

import numpy as np

from paint_deposition.batch.cases import content_digest


def test_arrays_count_by_their_values():
    values = np.arange(12.0).reshape(3, 4)
    elsewhere = np.frombuffer(bytearray(values.tobytes()), np.dtype('f8', copy=True))
    digest = content_digest({'values': values})
    assert content_digest({'values': elsewhere.reshape(3, 4)}) == digest
    assert content_digest({'values': np.asfortranarray(values)}) == digest
    others = (values + np.eye(3, 4), values.reshape(4, 3), values.astype(np.float32), [values])
    for other in others:
        assert content_digest({'values': other}) != digest
