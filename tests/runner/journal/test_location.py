"""Where a journal may lie: on a disk of this machine."""

from pathlib import Path

import pytest

from protocol.errors import BadInput
from runner.journal.location import checked_place, mounts_of_this_machine

MOUNTS = [("/", "ext4"), ("/net/lab", "nfs4"), ("/net/lab/local", "xfs"), ("/media/share", "cifs")]


@pytest.mark.parametrize(
    ("folder", "why"),
    [
        ("/net/lab/study", r"on a network \(nfs4\)"),
        ("/media/share/a/b", r"on a network \(cifs\)"),
        ("/home/someone/Dropbox/study", r"synchronised \(Dropbox\)"),
        ("/home/someone/OneDrive - Lab/study", r"synchronised \(OneDrive - Lab\)"),
    ],
)
def test_network_and_cloud_folders_are_refused(folder: str, why: str) -> None:
    with pytest.raises(BadInput, match=f"{folder}: a journal cannot be kept here, it is {why}"):
        checked_place(Path(folder), MOUNTS)


@pytest.mark.parametrize("folder", ["/home/someone/study", "/net/lab/local/study", "/net/labels"])
def test_local_folders_are_fine(folder: str) -> None:
    assert checked_place(Path(folder), MOUNTS) == Path(folder).resolve()


def test_a_share_that_an_automounter_mounted_is_refused() -> None:
    mounts = [("/", "ext4"), ("/home/lab", "autofs"), ("/home/lab", "nfs4")]
    with pytest.raises(BadInput, match=r"/home/lab/study: .* on a network \(nfs4\)"):
        checked_place(Path("/home/lab/study"), mounts)


def test_this_machine_says_what_is_mounted() -> None:
    assert "/" in dict(mounts_of_this_machine())
