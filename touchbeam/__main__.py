"""The commands where `touchbeam` itself is not on the path: `python -m touchbeam`."""

import sys
from pathlib import Path

# Python looks first in the folder in which it is started, which may be a stranger's study.
if sys.path[:1] == [str(Path.cwd())] and Path(__file__).parents[1] != Path.cwd():
    del sys.path[0]

from touchbeam.cli.app import main

if __name__ == "__main__":
    main()
