"""The whole study with virtual participants on the simulated device."""

from collections.abc import Callable, Sequence

from runner.sitting import Sitting, sit
from runner.study_folder import StudyFolder


def rehearsed_cohort(
    folder: StudyFolder,
    participants: int,
    seed: int,
    touchbeam: Sequence[str],
    seated: Callable[[], None],
) -> None:
    """Run one session for each of `participants` virtual participants, P01 on.

    Args:
        folder: a study that has been written.
        participants: how many.
        seed: what their characters and the simulated device follow from.
        touchbeam: the command that starts touchbeam.
        seated: called after each session.
    """
    for number in range(1, participants + 1):
        sitting = Sitting(
            folder=folder,
            participant=f"P{number:02d}",
            device="sim",
            ratings="virtual",
            seed=seed,
            touchbeam=touchbeam,
        )
        sit(sitting, say=lambda _: None)
        seated()
