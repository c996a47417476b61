"""Which tests are to find the errors of which module: quick ones, those that find most first."""

from collections.abc import Mapping

_LIMITS = "tests/device/drivers/test_limits.py"
_DRIVERS = (
    "tests/device/drivers/test_dialogues.py", "tests/device/drivers/test_driver.py",
    "tests/device/drivers/test_generator.py",
    "tests/system/test_lying_devices.py", "tests/device/rig", "tests/device/test_resonance.py",
    "tests/device/drivers/test_board.py", "tests/system/test_lies.py",
    "tests/system/test_lies_while_sliding.py",
    "tests/device/force_channel/test_recording.py", "tests/device/simulator/test_in_process.py",
    "tests/device/drivers/test_discovery.py",
)  # fmt: skip
_STORE = "tests/runner/journal/test_store.py"
_AMENDED = "tests/runner/journal/test_amendments.py"
_JOURNAL: Mapping[str, tuple[str, ...]] = {
    "amendments": (
        _AMENDED, "tests/runner/journal/test_accepted.py", "tests/runner/journal/test_guessing.py",
        "tests/touchbeam/cli/test_withdraw.py", "tests/runner/session/test_resume.py",
    ),
    "cohort": (
        "tests/runner/journal/test_cohort.py", _AMENDED, "tests/runner/session/test_resume.py",
        "tests/runner/launch",
    ),
    "database": (
        _STORE, "tests/runner/journal/test_database.py", "tests/runner/journal/test_log.py",
        "tests/runner/journal/test_backup.py", "tests/runner/journal/test_foreign_files.py",
    ),
    "names": (
        "tests/runner/journal/test_names.py", "tests/runner/journal/test_cohort.py", _AMENDED,
    ),
    "opening": (
        "tests/runner/journal/test_location.py", _STORE, "tests/runner/journal/test_database.py",
        "tests/runner/journal/test_log.py", "tests/runner/journal/test_foreign_files.py",
    ),
    "store": (
        _STORE, _AMENDED, "tests/runner/journal/test_chain.py",
        "tests/runner/journal/test_session_log.py",
        "tests/runner/journal/test_database.py", "tests/runner/journal/test_log.py",
        "tests/runner/journal/test_backup.py", "tests/runner/journal/test_guessing.py",
    ),
    "verification": (
        "tests/runner/journal/test_verification.py", _STORE, _AMENDED,
        "tests/runner/journal/test_backup.py",
        "tests/runner/study/test_registered.py",
    ),
}  # fmt: skip
_EVENTS = (
    "tests/protocol/journal", "tests/runner/study/test_sent_folders.py",
    "tests/system/test_imported_study.py",
)  # fmt: skip
_STUDY_FILE = (
    "tests/protocol/study_file/test_limits.py", "tests/protocol/study_file/test_loading.py",
    "tests/protocol/study_file", "tests/protocol/study/test_group.py",
    "tests/protocol/study/test_factor.py", "tests/protocol/study/test_touch.py",
    "tests/protocol/plan/test_feasibility.py", "tests/runner/launch/test_groups.py",
)  # fmt: skip
_SESSION = (
    "tests/runner/session/test_measured.py",
    "tests/runner/session/test_trial.py", "tests/runner/session/test_waiting.py",
    "tests/runner/session",
)  # fmt: skip

SELECTIONS: Mapping[str, tuple[str, ...]] = {
    "device/drivers/limits.py": (_LIMITS,),
    "device/study_limits.py": ("tests/device/test_study_limits.py",),
    "protocol/proof/slide_checks.py": (
        "tests/protocol/plan/test_slide_plan.py", "tests/runner/launch/test_opened_session.py",
    ),
    "protocol/proof/trial_checks.py": (
        "tests/protocol/proof", "tests/protocol/plan/test_plan.py",
        "tests/protocol/plan/test_retries.py", "tests/protocol/study/test_group.py",
        "tests/protocol/plan/test_feasibility.py",
    ),
    "protocol/study_file/limits.py": _STUDY_FILE,
    "runner/session/loop.py": _SESSION,
    "runner/session/measured.py": _SESSION,
    "device/rig.py": (
        "tests/device/rig", "tests/device/simulator/test_in_process.py",
        "tests/device/force_channel/test_recording.py", "tests/device/gauges",
    ),
    "device/port_owner.py": (
        "tests/device/gauges", "tests/device/rig", "tests/device/force_channel/test_recording.py",
    ),
    "runner/session/trial.py": _SESSION,
    "runner/session/waiting.py": _SESSION,
    "runner/session/watchdog.py": ("tests/runner/session/test_watchdog.py",),
    "protocol/journal/state.py": (
        "tests/protocol/journal/test_transitions.py", "tests/protocol/journal/test_state.py",
    ),
    "protocol/journal/json_record.py": _EVENTS,
    "protocol/journal/records.py": _EVENTS,
    "protocol/journal/events.py": _EVENTS,
    **{
        f"device/drivers/{name}.py": _DRIVERS
        for name in ("board", "driver", "generator", "keysight", "rigol", "siglent")
    },
    **{f"runner/journal/{name}.py": selection for name, selection in _JOURNAL.items()},
}  # fmt: skip
"""The modules that guard finger and data."""
