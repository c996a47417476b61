"""The location of a journal: a local disk."""

import re
from pathlib import Path

import pytest

from protocol.errors import BadInput
from runner.journal.opening import checked_place, mounts_of_this_machine

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


@pytest.mark.parametrize(
    "kind",
    [
        "9p", "afs", "ceph", "cifs", "davfs", "fuse.gvfsd-fuse", "fuse.rclone", "fuse.sshfs",
        "glusterfs", "ncpfs", "nfs", "nfs4", "smb3", "smbfs",
    ],
)  # fmt: skip
def test_each_kind_of_network_folder_is_refused(kind: str) -> None:
    mounts = [("/", "ext4"), ("/share", kind)]
    with pytest.raises(BadInput, match=rf"^/share/a: must not be on a network \({kind}\), where"):
        checked_place(Path("/share/a"), mounts)


@pytest.mark.parametrize(
    "folder",
    [
        "Box Sync", "Dropbox (Lab)", "Google Drive", "GoogleDrive", "iCloud Drive",
        "Mobile Documents", "My Drive", "Nextcloud", "OneDrive", "ownCloud", "Seafile",
    ],
)  # fmt: skip
def test_each_cloud_folder_is_refused_wherever_it_is(folder: str) -> None:
    for place in (Path("/home", folder), Path("/home", folder, "a/study")):
        with pytest.raises(BadInput, match=f"by a cloud service \\({re.escape(folder)}\\), where"):
            checked_place(place, [("/", "ext4")])


def test_the_innermost_mount_counts_in_whatever_order_they_are_listed() -> None:
    with pytest.raises(BadInput, match=r"on a network \(nfs4\)"):
        checked_place(Path("/net/lab/study"), [("/net/lab", "nfs4"), ("/", "ext4")])
    mounts = [("/net/lab/local", "xfs"), ("/net/lab", "nfs4"), ("/", "ext4")]
    assert checked_place(Path("/net/lab/local/a"), mounts) == Path("/net/lab/local/a")


def test_all_mounts_are_asked_for_as_network_folders_are_no_disks(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked: list[object] = []

    def listed(**options: object) -> list[object]:
        asked.append(options)
        return []

    monkeypatch.setattr("psutil.disk_partitions", listed)
    assert mounts_of_this_machine() == []
    assert asked == [{"all": True}]


def test_a_folder_on_no_known_mount_is_accepted() -> None:
    assert checked_place(Path("/home/study"), []) == Path("/home/study")


def test_a_system_that_lists_no_mounts_has_none(monkeypatch: pytest.MonkeyPatch) -> None:
    def unlisted(**_: object) -> None:
        raise OSError("no /proc")

    monkeypatch.setattr("psutil.disk_partitions", unlisted)
    assert mounts_of_this_machine() == []


@pytest.mark.parametrize("folder", ["/home/someone/study", "/net/lab/local/study", "/net/labels"])
def test_local_folders_are_accepted(folder: str) -> None:
    assert checked_place(Path(folder), MOUNTS) == Path(folder).resolve()


def test_a_share_mounted_by_an_automounter_is_refused() -> None:
    mounts = [("/", "ext4"), ("/home/lab", "autofs"), ("/home/lab", "nfs4")]
    with pytest.raises(BadInput, match=r"/home/lab/study: .* on a network \(nfs4\)"):
        checked_place(Path("/home/lab/study"), mounts)


def test_the_mounts_of_this_machine_are_listed() -> None:
    assert "/" in dict(mounts_of_this_machine())
