"""A path in a command that touchbeam proposes is one that a shell reads as that path."""

import os
import shutil
import subprocess

import pytest

from protocol.errors import typed_as

PATHS = (
    b"study", b"my study", "Übung/触觉".encode(), b"caf\xe9", b"caf\xe95", b"it's", b"a\\b\xff",
    b"line\nfeed", b"\x1b[2J", b"$(id)\xe9`id`", "\u202e".encode(),
)  # fmt: skip


@pytest.mark.parametrize("path", PATHS)
def test_a_shell_reads_the_path(path: bytes) -> None:
    typed = typed_as(os.fsdecode(path))
    assert typed.isprintable()
    shell = shutil.which("bash")
    if shell is None:
        pytest.skip("bash is not installed")
    said = subprocess.run([shell, "-c", f"printf %s {typed}"], capture_output=True, check=True)
    assert said.stdout == path


def test_halves_of_characters_that_stand_for_no_bytes_are_no_error() -> None:
    assert typed_as("\ud800") == r"$'\xed\xa0\x80'"
