"""The content of a block of samples. docs/wire-protocol.md says the same.

Little-endian: number of the first sample, count, flags, device time of the first sample, the
samples with their three channels side by side, and the CRC-32 of everything before it.
"""

import math
import struct
import sys
import zlib
from array import array
from dataclasses import dataclass

from device.errors import ProtocolError
from device.force_channel.samples import CHANNELS

SAMPLES_LOST = 1
"""The flag of a block before which samples were lost."""
_HEADER = struct.Struct("<IHHd")
_CRC = struct.Struct("<I")


@dataclass(frozen=True, kw_only=True)
class Block:
    """Consecutive samples; `counts` holds the three counts of each, one sample after the other."""

    first: int
    first_s: float
    counts: "array[int]"
    lost: bool = False

    @property
    def count(self) -> int:
        """The number of samples."""
        return len(self.counts) // CHANNELS


def encoded(block: Block) -> bytes:
    """Return `block` as bytes, its digest at the end."""
    flags = SAMPLES_LOST if block.lost else 0
    header = _HEADER.pack(block.first, block.count, flags, block.first_s)
    body = header + little_endian(block.counts)
    return body + _CRC.pack(zlib.crc32(body))


def decoded(content: bytes) -> Block:
    """Return the block of samples that `content` holds.

    Raises:
        ProtocolError: it is cut short, was changed on its way, or contradicts itself.
    """
    body, digest = content[: -_CRC.size], content[-_CRC.size :]
    if len(body) < _HEADER.size:
        raise ProtocolError(f"a block of samples must have 20 bytes or more, got {len(content)}")
    if _CRC.unpack(digest)[0] != zlib.crc32(body):
        raise ProtocolError("a block of samples differs from its digest")
    first, count, flags, first_s = _HEADER.unpack_from(body)
    counts = array("h")
    if len(body) != _HEADER.size + CHANNELS * counts.itemsize * count:
        raise ProtocolError(f"a block must hold its {count} samples, got {len(content)} bytes")
    if flags & ~SAMPLES_LOST or not math.isfinite(first_s):
        raise ProtocolError(f"a block must have known flags and a time, got {flags}, {first_s}")
    counts.frombytes(body[_HEADER.size :])
    if sys.byteorder == "big":
        counts.byteswap()
    return Block(first=first, first_s=first_s, counts=counts, lost=bool(flags))


def little_endian(counts: "array[int]") -> bytes:
    """Return `counts` as bytes, least byte first."""
    if sys.byteorder == "big":
        counts = counts[:]
        counts.byteswap()
    return counts.tobytes()
