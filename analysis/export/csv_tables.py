"""Tables as CSV, each with a JSON file that describes its columns."""

from collections.abc import Iterable, Sequence

import pandas as pd

from analysis.cells import BETWEEN_TOUCHES, csv_cell, csv_of_columns, json_text
from analysis.export.columns import CONTRAST_COLUMNS, TOUCH_COLUMNS, Column, known, names_of
from analysis.export.dataset import Chain, Dataset
from analysis.export.recordings import DRIVEN, MEASURED, TIME, samples_csv
from analysis.export.trial_table import touch_table
from analysis.loading.records import values
from protocol.journal.events import ScoresImported, SessionOpened, StudyRegistered, Withdrawn
from protocol.journal.shared_form import FOLDER, REGISTRATION_FILE, STUDY_FILE, SUFFIX, shared_text


def csv_tables(data: Dataset, *, shared: bool = False) -> dict[str, str]:
    """Return tables of trials, touches, contrasts and participants, each with its description.

    Args:
        data: what is exported.
        shared: whether others are to have it, who get no private columns.
    """
    columns = data.shared_columns if shared else data.columns
    touches = touch_table(data.trials)
    return {
        **_table("trials", data.trials, columns, data),
        # Published scores have no touches; an empty table would look like a loss.
        **({} if touches.empty else _table("touches", touches, TOUCH_COLUMNS, data)),
        **_table("contrasts", data.contrasts, CONTRAST_COLUMNS, data),
        **_table("participants", data.participants, data.participant_columns, data),
    }


def _table(
    name: str, table: pd.DataFrame, columns: Sequence[Column], data: Dataset
) -> dict[str, str]:
    names = names_of(columns)
    return {
        f"{name}.csv": csv_of_columns(names, (values(table[name]) for name in names)),
        f"{name}.json": json_text({csv_cell(it.name): _described(it, data) for it in columns}),
    }


def csv_recordings(data: Dataset) -> dict[str, bytes]:
    """Return a table of samples for each session that recorded touches, and what describes it."""
    files = {
        f"recordings/{data.subject_labels[who]}_session-{number}.csv": samples_csv(touches)
        for (who, number), touches in data.recorded_by_session()
    }
    columns = {it.name: _described(it, data) for it in (TIME, *MEASURED, *DRIVEN)}
    return {**files, "recordings/recordings.json": json_text(columns).encode()} if files else {}


def _described(column: Column, data: Dataset) -> dict[str, object]:
    return known(
        {
            "description": data.meaning(column),
            "unit": column.unit,
            "levels": dict(data.levels(column)),
            "one_per_touch_separated_by": BETWEEN_TOUCHES if column.per_touch else None,
            "any_separated_by": BETWEEN_TOUCHES if column.several else None,
        }
    )


# What a data set was made from: study file, registration, and sessions' events as they may leave.
#
# `touchbeam import` makes a study of these files again; docs/data.md lists what they do not hold.


def source_files(data: Dataset, chains: Iterable[Chain], study_text: str) -> dict[str, str]:
    """Return the files by path: of the sessions of `data`, whose events are among `chains`.

    Args:
        data: what is exported.
        chains: the events of all sessions, in their order.
        study_text: the study file with its own languages.
    """
    files = {f"{FOLDER}/{STUDY_FILE}": study_text}
    for place, events in enumerate(chains):
        first = events[0]
        found = [event.record for event in events if event.tag == StudyRegistered.TAG]
        registered = [record.text for record in found if isinstance(record, StudyRegistered)]
        files |= {f"{FOLDER}/{REGISTRATION_FILE}": text for text in registered}
        # Checked before the first event is read, because withdrawal erases what it said.
        withdrawn = any(event.tag == Withdrawn.TAG for event in events)
        opened = None if withdrawn else first.record
        if not isinstance(opened, SessionOpened | ScoresImported):
            continue
        # Only sessions of the tables go along, so that both tell of the same people.
        subject = data.subject_of.get((opened.participant, opened.session, opened.kind))
        if subject is not None:
            name = "_".join(data.entities(subject, opened.session))
            files[f"{FOLDER}/{name}{SUFFIX}"] = shared_text(place, events)
    return files
