"""Saves a picture of every page, in both languages and on a small and a large screen.

python -m tests.runner.window.pictures FOLDER
"""

import os
import subprocess
import sys

from tests.runner.window.person import virtual_display

SIZES = ((800, 600), (1920, 1080))


def main(folder: str) -> None:
    """Draw everything."""
    for size in SIZES:
        with virtual_display(*size) as display:
            for language in ("en", "zh"):
                subprocess.run(
                    [sys.executable, "-m", "tests.runner.window.drawn", language, folder],
                    env={**os.environ, "DISPLAY": display},
                    check=True,
                )


if __name__ == "__main__":
    main(sys.argv[1])
