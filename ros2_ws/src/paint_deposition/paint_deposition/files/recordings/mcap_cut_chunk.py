"""The readable beginning of an MCAP chunk whose end is missing.

Recorders that close a chunk at a megabyte leave half a minute of poses in the last, cut one.
"""

import struct
from dataclasses import replace
from io import BytesIO

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Chunk

# opcode, record length
RECORD_HEAD = struct.Struct('<BQ')


def readable_beginning(record: bytes) -> Chunk | None:
    """An uncompressed chunk of the whole messages in a cut chunk record, None if there are none.

    The checksum of the chunk covers all of it and cannot be checked any more.
    """
    if record[:1] != bytes([Opcode.CHUNK]):
        return None
    try:
        chunk = Chunk.read(ReadDataStream(BytesIO(record[RECORD_HEAD.size :])))
    except (McapError, struct.error, ValueError, OverflowError):
        return None
    data = _whole_records(_decompressed(chunk.data, chunk.compression))
    if not data:
        return None
    return replace(
        chunk, compression='', data=data, uncompressed_crc=0, uncompressed_size=len(data)
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
