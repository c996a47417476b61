"""Random bytes for the codec, in chunks that cut lines anywhere."""

import random
from collections.abc import Iterator

ALPHABETS = (
    bytes(range(256)),
    b"0123456789.eE+-,;\r\n",
    b'ONOFF01NANINF9.91E37_\r\n"',
)


def chunks(seed: int, lines: int) -> Iterator[bytes]:
    """Chunks of bytes that hold `lines` line ends."""
    stream = random.Random(seed)
    ended = 0
    while ended < lines:
        alphabet = stream.choice(ALPHABETS)
        body = bytes(stream.choices(alphabet, k=stream.randrange(64)))
        chunk = body + stream.choice((b"\n", b"\r\n", b"\r", b""))
        ended += sum(chunk.count(end) for end in (b"\n", b"\r"))
        yield chunk
