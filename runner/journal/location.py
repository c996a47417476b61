"""The location of a journal: not in network or cloud folders, which lose or fork SQLite files."""

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
"""A mount point and the type of its file system."""


def checked_place(folder: Path, mounts: Iterable[Mount]) -> Path:
    """Return the absolute path of `folder`; raises `BadInput` on a network or in a cloud folder."""
    # A link in a local folder may lead to a network.
    absolute = folder.resolve()
    for part in absolute.parts:
        # Such as "OneDrive - University", hence the beginning alone.
        if part.casefold().startswith(CLOUD_FOLDERS):
            raise BadInput(_refusal(folder, f"synchronised by a cloud service ({part})"))
    holding = [(place, kind) for place, kind in mounts if absolute.is_relative_to(place)]
    # Of several mounts at one place the last hides the others, such as an automounter's.
    by_depth = sorted(holding, key=lambda mount: len(PurePath(mount[0]).parts))
    kind = by_depth[-1][1] if by_depth else ""
    if kind in NETWORK_TYPES:
        raise BadInput(_refusal(folder, f"on a network ({kind})"))
    return absolute


def mounts_of_this_machine() -> list[Mount]:
    """Return the mounts of this machine; an empty list if the system does not list them."""
    import psutil

    try:
        return [(entry.mountpoint, entry.fstype) for entry in psutil.disk_partitions(all=True)]
    except OSError:
        return []


def _refusal(folder: Path, why: str) -> str:
    return f"{folder}: must not be {why}, where journals get damaged; use a folder on a local disk"
