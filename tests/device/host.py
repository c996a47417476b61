"""A host that drives a device and is then killed or stopped; run as a process of its own."""

import sys
import time

from device.rig import open_rig
from tests.device.rigs import DRIVE, LIMITS


def main(url: str, rate_hz: int = 0) -> None:
    """Drive the device at `url`, record its forces if there is a rate, say so, and live on."""
    rig = open_rig(url, LIMITS)
    rig.arm()
    rig.drive(DRIVE)
    if rate_hz:
        rig.record(rate_hz)
    print("on", flush=True)
    while True:
        rig.beat()
        time.sleep(0.02)


if __name__ == "__main__":
    main(sys.argv[1], *map(int, sys.argv[2:]))
