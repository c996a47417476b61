"""The two kinds of errors that are not ours, told apart by the exit code of a command."""


class BadInput(ValueError):
    """A file or value that was given is wrong; the message says what, where and what to do."""


class WorkFailed(Exception):
    """Something that the work needs - a device, a port, a disk, a person - does not do its part."""
