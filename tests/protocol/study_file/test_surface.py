"""The table `[surface]` of a study file: what it may say, and how each mistake is refused."""

import re

import pytest

from protocol.study_file.loading import StudyError, parsed_study, template
from runner.study.check import validated_study
from tests.protocol.surfaces import ALUMINIUM, MEASURED, paper_on, study_files

GIVEN = '[surface]\nkind = "given"\nlength_m = 0.1\n'


def without(text: str, line: str) -> str:
    assert line in text
    return text.replace(line, "", 1)


def test_without_the_table_it_is_the_papers_beam() -> None:
    study = parsed_study(template("paper"))
    assert "surface" not in study.model_fields_set
    assert (study.surface.kind, study.surface.is_own_beam) == ("beam", False)


def test_a_study_that_was_dumped_reads_as_it_was() -> None:
    study = parsed_study(str(study_files("beam")["study.toml"]))
    assert study.surface.is_own_beam
    assert type(study).model_validate(study.model_dump(exclude_none=True)).surface == study.surface


@pytest.mark.parametrize(
    ("surface", "said"),
    [
        (without(ALUMINIUM, "density_kg_m3 = 2700\n"), "got no density_kg_m3"),
        (ALUMINIUM.partition("[[")[0], "got no patch"),
        (ALUMINIUM.replace("0.33", "0.5"), "surface.poisson_ratio: must be below 0.5, got 0.5"),
        (ALUMINIUM.replace("70e9", "70"), "surface.youngs_modulus_pa: must be at least 1000000"),
        (ALUMINIUM.replace('"clamped", "clamped"', '"clamped", "fixed"'), "got 'fixed'"),
        (ALUMINIUM.replace("mode = 6", "mode = 41"), "surface.mode: must be at most 40, got 41"),
        (ALUMINIUM.replace("[surface]", '[surface]\ntable = "a.csv"'), "no such key, got table"),
        (ALUMINIUM.replace("thickness_m = 0.003", "thickness_m = 3"), "in m: 3 mm is 0.003"),
        (MEASURED.replace("friction.csv", "../friction.csv"), "must name a .csv file in the study"),
        (MEASURED.replace('table = "friction.csv"', ""), "needs length_m, table, got no table"),
        (MEASURED, "surface.table: must name a .csv file in the study's folder that can be read"),
        ('[surface]\nkind = "given"\n', "needs length_m, got no length_m"),
        ('[surface]\nkind = "plate"\nlength_m = 0.1\n', "got 'plate'"),
        (
            f"{GIVEN}path_in_picture = [[0.1, 0.5], [0.9, 0.5]]\n",
            "surface.path_in_picture: must stand beside a picture, got none",
        ),
        (f'{GIVEN}picture = "no.png"\n', "surface.picture: must"),
    ],
)
def test_a_wrong_table_is_refused_in_one_line(surface: str, said: str) -> None:
    with pytest.raises(StudyError, match=re.escape(said)) as caught:
        parsed_study(paper_on(surface))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("surface", "said"),
    [
        (ALUMINIUM.replace("centre_m = 0.072", "centre_m = 0.118"), "surface.patch"),
        (
            ALUMINIUM.replace("mode = 6", "mode = 40").replace("0.003", "0.03"),
            "mode: must lie below the beam's cut-off",
        ),
        (GIVEN.replace("0.1", "0.05"), "must lie on the surface, which ends at"),
    ],
)
def test_a_beam_that_cannot_be_is_refused_in_one_line(surface: str, said: str) -> None:
    with pytest.raises(StudyError, match=re.escape(said)) as caught:
        validated_study(paper_on(surface), "study.toml")
    assert "\n" not in str(caught.value)


def test_the_paths_of_the_papers_beam_are_not_taken_on_another_one() -> None:
    text = paper_on(ALUMINIUM)
    for key in ("path_m", "smooth_place_m"):
        with pytest.raises(StudyError, match=f"touch.{key}: must be given where"):
            parsed_study(re.sub(rf"^{key} .*$", "", text, flags=re.MULTILINE))


@pytest.mark.parametrize(
    ("surface", "touch", "said"),
    [
        (ALUMINIUM, "voltage_v = 100, friction = 0.3", 'is for [surface] kind = "given"'),
        (
            GIVEN,
            "voltage_v = 0, ramp_to_v = 100, friction = 0.3",
            "is for a touch with one drive",
        ),
        (
            GIVEN,
            "voltage_v = 100, friction = 0",
            "friction: must be at least 0.001, got 0",
        ),
    ],
)
def test_friction_is_stated_where_nothing_else_says_it(surface: str, touch: str, said: str) -> None:
    old = 'place = "smooth", voltage_v = 100, press = 1.5'
    text = paper_on(surface, (old, f'place = "smooth", {touch}'))
    with pytest.raises(StudyError, match=re.escape(said)):
        parsed_study(text)
