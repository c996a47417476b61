"""What paces the finger: its way along the beam and how long that takes."""

from protocol.programme import touch_s
from protocol.study import Touch, TouchDefaults
from runner.screens import Pacing


def pacing(touch: Touch, finger: TouchDefaults) -> Pacing:
    """Return the cue for `touch`: a place that is held, or a way at the study's sliding speed."""
    start_m = end_m = finger.smooth_place_m
    if touch.place == "path":
        start_m, end_m = finger.path_m if touch.direction == "right" else finger.path_m[::-1]
    return Pacing(
        start_m=start_m,
        end_m=end_m,
        duration_s=touch_s(touch, finger),
        force_n=finger.force_n * touch.press,
        direction=touch.direction,
        harder=touch.press > 1,
        several=touch.coverage == "full",
    )
