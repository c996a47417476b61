"""A host that drives a device and is then killed or stopped; run as a process of its own."""

import sys
import time

from device.rig import open_rig
from tests.device.rigs import DRIVE, LIMITS


def main(url: str, rate_hz: str = "0", dialect: str = "board") -> None:
    """Drive the device at `url`, record its forces if there is a rate, say so, and live on."""
    rig = open_rig(url, LIMITS, dialect)
    rig.arm()
    rig.drive(DRIVE)
    if int(rate_hz):
        rig.record(int(rate_hz))
    print("on", flush=True)
    while True:
        rig.beat()
        time.sleep(0.02)


if __name__ == "__main__":
    main(sys.argv[1], *sys.argv[2:])
