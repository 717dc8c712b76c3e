"""The readable beginning of an MCAP chunk whose end is missing.

Recorders that close a chunk at a megabyte leave half a minute of poses in the last, cut one.
"""

from __future__ import annotations

import struct

import lz4.frame
import zstandard
from mcap.opcode import Opcode
from mcap.records import Chunk

# opcode, record length; start and end time, uncompressed size, CRC, length of the compression name
HEAD = struct.Struct('<BQQQQII')
RECORD_HEAD = struct.Struct('<BQ')


def readable_beginning(record: bytes) -> Chunk | None:
    """An uncompressed chunk of the whole messages in a cut chunk record, None if there are none.

    The checksum of the chunk covers all of it and cannot be checked any more.
    """
    if len(record) < HEAD.size or record[0] != Opcode.CHUNK:
        return None
    _, _, start_ns, end_ns, _, _, name_length = HEAD.unpack_from(record)
    data_at = HEAD.size + name_length + 8
    compression = record[HEAD.size : HEAD.size + name_length].decode('ascii', errors='replace')
    whole = _whole_records(_decompressed(record[data_at:], compression))
    if not whole:
        return None
    return Chunk(
        compression='',
        data=whole,
        message_end_time=end_ns,
        message_start_time=start_ns,
        uncompressed_crc=0,
        uncompressed_size=len(whole),
    )


def _decompressed(data: bytes, compression: str) -> bytes:
    try:
        if compression == 'zstd':
            return zstandard.ZstdDecompressor().decompressobj().decompress(data)
        if compression == 'lz4':
            return lz4.frame.LZ4FrameDecompressor().decompress(data)
    except (zstandard.ZstdError, RuntimeError):
        return b''
    return data if compression == '' else b''


def _whole_records(data: bytes) -> bytes:
    end = 0
    while end + RECORD_HEAD.size <= len(data):
        _, length = RECORD_HEAD.unpack_from(data, end)
        if end + RECORD_HEAD.size + length > len(data):
            break
        end += RECORD_HEAD.size + length
    return data[:end]
