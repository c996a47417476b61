"""Exports of a study that scores what is felt at once: words, values, and the validator of BIDS."""

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest

from analysis.export.dataset import Dataset, dataset
from analysis.export.formats import EXPORTS
from analysis.export.readme import readme
from tests.analysis.export.test_formats import ONLY_THE_AUTHOR_KNOWS, warnings, written
from tests.analysis.rated import RATED, rated_cohort


def rated() -> Dataset:
    return dataset(rated_cohort(people=2), RATED, "0", rehearsals=False)


@pytest.mark.parametrize("form", EXPORTS)
def test_every_export_tells_the_scale_and_that_nothing_was_asked(form: str) -> None:
    text = "".join(EXPORTS[form](rated()).values())
    assert "of what was felt, from 1 to 7 (1-3: smooth; 4-7: rough)." in text
    # Tables alone have no description of the study.
    assert form == "csv" or "scores what was felt, from 1 to 7." in text
    assert "says what changed" not in text
    assert "asks about" not in text
    assert not re.search(r"0 to 10\b|very effective|Table 4|comprehensive", text)


def test_catch_trials_have_scores_and_no_response() -> None:
    trials = rated().trials
    catch = trials[trials["trial_kind"].eq("catch")]
    counting = trials[trials["trial_kind"].eq("trial")]
    assert catch["score"].notna().all()
    assert catch["response"].isna().all()
    assert (counting["response"] == counting["score"]).all()
    # The score was the only answer: its time is both.
    assert (counting["score_reaction_time_s"] == counting["reaction_time_s"]).all()


def test_the_bids_data_set_is_valid(tmp_path: Path) -> None:
    folder = written(EXPORTS["bids"](rated()), tmp_path)
    assert warnings(folder) <= ONLY_THE_AUTHOR_KNOWS
    (sidecar,) = folder.glob("sub-P01/beh/*_beh.json")
    described = json.loads(sidecar.read_text(encoding="utf-8"))
    assert described["condition"]["Levels"]["20 V"] == "scored at once, without a question"


def test_the_readme_says_that_rules_of_exclusion_are_not_applied() -> None:
    applied = "the rules of exclusion in the study file are not applied here"
    data = rated()
    assert applied not in readme(data, "")
    rules = data.study.exclusions.model_copy(update={"min_reaction_s": 0.2})
    ruled = replace(data, study=data.study.model_copy(update={"exclusions": rules}))
    assert applied in readme(ruled, "")
