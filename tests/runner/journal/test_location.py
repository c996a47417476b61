"""The location of a journal: a local disk."""

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
        ("/home/someone/Dropbox/study", r"synchronised by a cloud service \(Dropbox\)"),
        ("/home/someone/OneDrive - Lab/study", r"by a cloud service \(OneDrive - Lab\)"),
    ],
)
def test_network_and_cloud_folders_are_refused(folder: str, why: str) -> None:
    with pytest.raises(BadInput, match=f"{folder}: must not be .*{why}, where journals get"):
        checked_place(Path(folder), MOUNTS)


@pytest.mark.parametrize("folder", ["/home/someone/study", "/net/lab/local/study", "/net/labels"])
def test_local_folders_are_accepted(folder: str) -> None:
    assert checked_place(Path(folder), MOUNTS) == Path(folder).resolve()


def test_a_share_mounted_by_an_automounter_is_refused() -> None:
    mounts = [("/", "ext4"), ("/home/lab", "autofs"), ("/home/lab", "nfs4")]
    with pytest.raises(BadInput, match=r"/home/lab/study: .* on a network \(nfs4\)"):
        checked_place(Path("/home/lab/study"), mounts)


def test_the_mounts_of_this_machine_are_listed() -> None:
    assert "/" in dict(mounts_of_this_machine())
