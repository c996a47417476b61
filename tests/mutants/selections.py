"""Which tests are to find the errors of which module: quick ones, those that find most first."""

from collections.abc import Mapping

_LIMITS = "tests/device/drivers/test_limits.py"
_DRIVERS = (_LIMITS, "tests/device/drivers", "tests/system/test_lies.py")
_BOARD = ("tests/system/test_lying_devices.py",)
_JOURNAL = (
    "tests/runner/journal/test_store.py", "tests/runner/journal/test_amendments.py",
    "tests/runner/journal/test_database.py", "tests/runner/journal/test_backup.py",
    "tests/runner/journal/test_guessing.py", "tests/runner/journal/test_location.py",
    "tests/runner/journal/test_versions.py", "tests/runner/journal/test_corruption.py",
    "tests/system/test_results_on_disk.py",
)  # fmt: skip
_STUDY_FILE = (
    "tests/protocol/study_file/test_limits.py", "tests/protocol/study_file/test_loading.py",
    "tests/protocol/study_file/test_consistency.py", "tests/protocol/plan/test_feasibility.py",
)  # fmt: skip
_SESSION = ("tests/runner/session", "tests/system/test_recovery.py", "tests/runner/test_signals.py")

SELECTIONS: Mapping[str, tuple[str, ...]] = {
    "device/drivers/limits.py": (_LIMITS,),
    "device/study_limits.py": ("tests/device/test_study_limits.py",),
    "protocol/proof/limit_checks.py": (
        "tests/protocol/proof/test_limit_checks.py", "tests/protocol/proof/test_trial_checks.py",
        "tests/protocol/plan/test_feasibility.py",
    ),
    "protocol/study_file/limits.py": _STUDY_FILE,
    "runner/session/loop.py": _SESSION,
    "device/rig.py": ("tests/device/test_rig.py", "tests/device/simulator/test_in_process.py"),
    "runner/session/trial.py": _SESSION,
    "runner/session/waiting.py": _SESSION,
    "protocol/journal/transitions.py": ("tests/protocol/journal", *_SESSION),
    "protocol/journal/state.py": ("tests/protocol/journal", *_SESSION, *_JOURNAL),
    **{
        f"device/drivers/{name}.py": (*_DRIVERS, *_BOARD)
        for name in (
            "board", "discovery", "driver", "generator", "keysight", "rigol", "scpi_generator",
            "siglent",
        )
    },
    **{
        f"runner/journal/{name}.py": _JOURNAL
        for name in (
            "amendments", "backup", "chain", "cohort", "database", "location", "session_log",
            "store", "verification",
        )
    },
}  # fmt: skip
"""The modules that guard finger and data."""
