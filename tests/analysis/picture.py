"""Saves a picture of the demo's report: `python -m tests.analysis.picture FILE.png`."""

import base64
import subprocess
import sys
import tempfile
from pathlib import Path

from tests.headless_browser import headless_browser

SIZE = {"width": 1280, "height": 860, "deviceScaleFactor": 1, "mobile": False}


def picture(folder: Path) -> bytes:
    """Return the top of the report as PNG; `folder` is an empty one."""
    demo = [sys.executable, "-m", "touchbeam", "demo", "--out", str(folder / "demo")]
    subprocess.run(demo, check=True, stdout=subprocess.DEVNULL)
    with headless_browser(folder / "profile") as browser:
        browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", SIZE)
        browser.execute_cdp_cmd("Emulation.setScrollbarsHidden", {"hidden": True})
        browser.get(f"file://{folder}/demo/report/report.html")
        shot = browser.execute_cdp_cmd("Page.captureScreenshot", {"format": "png"})
    return base64.b64decode(shot["data"])


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as place:
        Path(sys.argv[1]).write_bytes(picture(Path(place)))
