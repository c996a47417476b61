"""Where a journal must not lie: network and cloud-synced folders lose or fork SQLite files."""

from collections.abc import Iterable
from pathlib import Path, PurePath

from protocol.errors import BadInput

NETWORK_TYPES = {
    "9p", "afs", "ceph", "cifs", "davfs", "fuse.gvfsd-fuse", "fuse.rclone", "fuse.sshfs",
    "glusterfs", "ncpfs", "nfs", "nfs4", "smb3", "smbfs",
}  # fmt: skip
CLOUD_FOLDERS = (
    "box sync", "dropbox", "google drive", "googledrive", "icloud drive", "mobile documents",
    "my drive", "nextcloud", "onedrive", "owncloud", "seafile",
)  # fmt: skip

Mount = tuple[str, str]
"""Where something is mounted, and the type of its file system."""


def checked_place(folder: Path, mounts: Iterable[Mount]) -> Path:
    """Return `folder`, made absolute, if a journal may lie there.

    Raises:
        BadInput: it is on a network or synchronised by a cloud service.
    """
    absolute = folder.resolve()
    for part in absolute.parts:
        if part.casefold().startswith(CLOUD_FOLDERS):
            raise BadInput(_refusal(folder, f"it is synchronised ({part})"))
    kind = _file_system(absolute, mounts)
    if kind in NETWORK_TYPES:
        raise BadInput(_refusal(folder, f"it is on a network ({kind})"))
    return absolute


def mounts_of_this_machine() -> list[Mount]:
    """Return what is mounted where; nothing on systems that do not say."""
    import psutil

    try:
        return [(entry.mountpoint, entry.fstype) for entry in psutil.disk_partitions(all=True)]
    except OSError:
        return []


def _file_system(path: Path, mounts: Iterable[Mount]) -> str:
    """Return the type of the innermost mount that contains `path`."""
    holding = [(place, kind) for place, kind in mounts if path.is_relative_to(place)]
    # Of several mounts at one place the last one hides the others: an automounter's lies below.
    by_depth = sorted(holding, key=lambda mount: len(PurePath(mount[0]).parts))
    return by_depth[-1][1] if by_depth else ""


def _refusal(folder: Path, why: str) -> str:
    return f"{folder}: a journal cannot be kept here, {why}; use a folder on this machine's disk"
