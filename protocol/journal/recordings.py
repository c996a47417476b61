"""What the force channel recorded during one touch: samples, their clock, and their digest.

Samples are kept as the sensor gave them, in counts of 16 bits. In the journal they are compressed
(zlib) and written in base64, so that an event stays a line of text.
"""

import zlib
from base64 import b64decode, b64encode
from dataclasses import dataclass
from hashlib import sha256
from typing import Annotated, Self

from protocol.journal.json_record import JsonRecord, Key

CHANNELS = ("tangential_n", "normal_n", "position_m")
"""The channels of a recording, in their order."""
BYTES_PER_COUNT = 2
FULL_SCALE = 32_767
"""A count of this size, of either sign, may be a sensor at its limit."""
MOST_COUNTS = 10**6
"""Per channel: more than the longest touch has, 600 s, at the highest rate, 1 kHz."""
_LEVEL = 1  # noise hardly compresses, and level 6 takes four times as long to save a twentieth


class DamagedSamplesError(Exception):
    """Samples that are not those that were recorded."""


@dataclass(frozen=True, kw_only=True)
class Recording(JsonRecord):
    """The samples of one touch, all channels at one rate, on the clock of their source."""

    source: Annotated[str, Key("what measured: `board`, or the dialect of the gauge")]
    rate_hz: Annotated[float, Key("samples per second and channel")]
    first_s: Annotated[float, Key("time of the first sample on the source's own clock, s")]
    count: Annotated[int, Key("samples per channel")]
    scale: Annotated[
        tuple[float, ...],
        Key("size of one count: tangential force (N), normal force (N), position (m)"),
    ]
    clock_offset_s: Annotated[float, Key("the session's clock minus the source's, s")]
    clock_error_s: Annotated[
        float,
        Key("largest error of that, by the shortest round trips at beginning and end, s"),
    ]
    moved_s: Annotated[
        tuple[float, ...],
        Key("when the mark began to move and when the touch was over, on the session's clock, s"),
    ]
    tare_n: Annotated[
        tuple[float, ...] | None,
        Key(
            "mean tangential and normal force just before, with nothing on the beam, N; null if "
            "something was",
            missing=None,
        ),
    ]
    saturated: Annotated[int, Key("samples in which a channel was at its limit", missing=0)]
    sha256: Annotated[str, Key("digest of the samples before compression")]
    samples: Annotated[
        str,
        Key(
            "16-bit counts, least byte first: all of tangential force, of normal force, of "
            "position; compressed with zlib, in base64"
        ),
    ]

    @classmethod
    def packed(cls, counts: bytes, **known: object) -> Self:
        """Return the recording of `counts`; `known` are the other keys."""
        return cls(
            samples=b64encode(zlib.compress(counts, _LEVEL)).decode("ascii"),
            sha256=sha256(counts).hexdigest(),
            count=len(counts) // (BYTES_PER_COUNT * len(CHANNELS)),
            **known,  # type: ignore[arg-type]
        )

    def counts(self) -> bytes:
        """Return the samples as 16-bit counts, least byte first, one channel after the other.

        Raises:
            DamagedSamplesError: they are not those that were recorded.
        """
        if not 0 <= self.count <= MOST_COUNTS:  # compressed, they fit into a thousandth of it
            raise DamagedSamplesError(f"samples cannot be {self.count} in number")
        expected = self.count * BYTES_PER_COUNT * len(CHANNELS)
        try:
            unpacker = zlib.decompressobj()
            counts = unpacker.decompress(b64decode(self.samples, validate=True), expected + 1)
        except (ValueError, zlib.error) as error:
            raise DamagedSamplesError(f"samples cannot be unpacked ({error})") from error
        if len(counts) != expected or sha256(counts).hexdigest() != self.sha256:
            raise DamagedSamplesError("samples differ from their digest")
        return counts
