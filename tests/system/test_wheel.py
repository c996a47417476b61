"""The package as it is installed elsewhere: complete, and at work outside the tree."""

import subprocess
import sys
import zipfile
from pathlib import Path

ROOT = Path(__file__).parents[2]


def test_the_wheel_works_outside_the_tree(tmp_path: Path) -> None:
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(tmp_path)]
    subprocess.run(build, cwd=ROOT, check=True, capture_output=True)
    (wheel,) = tmp_path.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(tmp_path / "site")
    assert (tmp_path / "site" / "touchbeam" / "py.typed").is_file()
    program = (
        "import sys; sys.path.insert(0, 'site'); import runner.cli; print(runner.cli.__file__);"
        "sys.argv = ['touchbeam', 'import', sys.argv[1], 'study']\n"
        "try: runner.cli.main()\n"
        "except SystemExit as stop: assert not stop.code\n"
        "import touchbeam; assert len(touchbeam.load('study').scores) == 9\n"
        "sys.argv = ['touchbeam', 'report', 'study']; runner.cli.main()"
    )
    shown = subprocess.run(
        [sys.executable, "-c", program, str(ROOT / "tests" / "data" / "published_scores.csv")],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert shown.returncode == 0, shown.stderr
    assert shown.stdout.startswith(str(tmp_path / "site"))
    assert "8.31" in shown.stdout
    assert (tmp_path / "study" / "report" / "report.html").is_file()
