"""What simulated studies tell of the thresholds of tracks: errors, coverage, trials, and claims."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from analysis.estimates import LEVEL, FloatArray, Json
from analysis.power import diagnosands
from analysis.power.diagnosands import Held, Measured, RegisteredPower, finite, ratio, share
from analysis.power.track_power import pairs_of_tracks, track_columns
from protocol.registration.registration import threshold_of, weber_below
from protocol.study.study import Study
from protocol.study.track import decibels

_MOST = 0.8
"""The share of studies that is power enough."""


@dataclass(frozen=True, kw_only=True)
class TrackPower:
    """How the thresholds of a track err, in dB, over studies of this many participants.

    `coverage` is of the 95% intervals; `trials` the mean number of them; `beyond` the share of
    people whose threshold no level of the track reaches, who count for none of the others.
    `weber_limit` is the Weber fraction that 80% of studies show to be above that of the cohort.
    """

    name: str
    bias_db: Measured
    rmse_db: Measured
    coverage: Measured
    trials: Measured
    beyond: Measured
    weber_limit: float


@dataclass(frozen=True, kw_only=True)
class TracksDiffer:
    """How often the signed rank test of the log thresholds of two tracks finds a difference.

    `above` names the track whose true thresholds are larger on average; `ratio_db` by how much.
    """

    above: str
    below: str
    ratio_db: float
    power: Measured


@dataclass(frozen=True, kw_only=True)
class TrackFindings:
    """What the tracks of a study tell, over this many studies of these participants."""

    participants: int
    studies: int
    tracks: tuple[TrackPower, ...]
    differences: tuple[TracksDiffer, ...]
    registered: tuple[RegisteredPower, ...] = ()

    def record(self) -> Json:
        """Return it as plain JSON values, each with its Monte Carlo error."""

        def pairs(of: TrackPower | TracksDiffer) -> Json:
            named: Json = {}
            for key, value in vars(of).items():
                if isinstance(value, Measured):
                    named |= value.as_json(key, f"{key}_mc_error")
                else:
                    named[key] = finite(value) if isinstance(value, float) else value
            return named

        registered = [{"name": it.name, **it.power.as_json("power")} for it in self.registered]
        return {
            "participants": self.participants,
            "studies": self.studies,
            "tracks": list(map(pairs, self.tracks)),
            "differences": list(map(pairs, self.differences)),
            **({"registered": registered} if registered else {}),
        }


def track_findings(
    study: Study, participants: int, rows: FloatArray, hypotheses: Sequence[str] = ()
) -> TrackFindings:
    """Return what the tracks tell, from the rows of `track_power.track_rows`.

    `hypotheses` are registered ones, all of them on tracks, the primary one first.
    """
    of = _named(study, rows)
    held = held_of_tracks(study, rows, hypotheses)
    return TrackFindings(
        participants=participants,
        studies=len(rows),
        tracks=tuple(_quality(each.name, of, participants) for each in study.track),
        differences=tuple(_difference(a.name, b.name, of) for a, b in pairs_of_tracks(study)),
        registered=diagnosands.registered_power(held, hypotheses),
    )


def held_of_tracks(study: Study, rows: FloatArray, hypotheses: Sequence[str]) -> Held:
    """Return in which studies a hypothesis on thresholds is supported, as a report decides it."""
    of = _named(study, rows)
    held: dict[str, tuple[str, FloatArray]] = {}
    for a, b in ((a.name, b.name) for a, b in pairs_of_tracks(study)):
        found, shift = of[a, b, "p"] < LEVEL, of[a, b, "shift"]
        for name, hit in ((threshold_of(a, b), shift > 0), (threshold_of(b, a), shift < 0)):
            held[name] = name, (found & hit).astype(np.float64)
    for name in hypotheses:
        limited = weber_below(name)
        limits = of.get((limited[0], "Weber limit")) if limited else None
        if limited and limits is not None:
            held[name] = name, (limits < limited[1]).astype(np.float64)
    return held


def _named(study: Study, rows: FloatArray) -> Mapping[tuple[str, ...], FloatArray]:
    return dict(zip(track_columns(study), rows.T, strict=True))


def _quality(name: str, of: Mapping[tuple[str, ...], FloatArray], participants: int) -> TrackPower:
    known = of[name, "known"]
    bias, squares, coverage, trials = (
        ratio(of[name, what], known) for what in ("error", "squared error", "covered", "trials")
    )
    limits = of[name, "Weber limit"]
    return TrackPower(
        name=name,
        bias_db=bias,
        rmse_db=diagnosands.root(squares),
        coverage=coverage,
        trials=trials,
        beyond=share(1 - known / participants),
        weber_limit=float(np.quantile(limits, _MOST, method="higher")),
    )


def _difference(a: str, b: str, of: Mapping[tuple[str, ...], FloatArray]) -> TracksDiffer:
    log_ratio = ratio(of[a, b, "true"], of[a, b, "known"]).value
    above, sign = ((a, b), 1) if not log_ratio < 0 else ((b, a), -1)
    found = (of[a, b, "p"] < LEVEL) & (sign * of[a, b, "shift"] > 0)
    return TracksDiffer(
        above=above[0],
        below=above[1],
        ratio_db=decibels(float(np.exp(abs(log_ratio)))),
        power=share(found),
    )
