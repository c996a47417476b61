"""The report in a browser without a network, used by keyboard, and in print."""

import base64
import json
import re
import shutil
import subprocess
from collections.abc import Iterator
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from selenium import webdriver
from selenium.webdriver.common.by import By
from selenium.webdriver.common.print_page_options import PrintOptions

from analysis.loading.sessions import load_sessions
from analysis.loading.study_data import study_data
from analysis.report.report import report, report_files
from protocol.journal.events import Answered, NoteTaken, SessionOpened, StoredEvent, TrialExcluded
from protocol.study.factor import Group
from runner.study.files import write_files
from tests.analysis.chains import chain
from tests.analysis.reports import EXTENDED, ORIGIN, session_events
from tests.headless_browser import PROGRAMS, headless_browser

NEEDED = (*PROGRAMS, "pdftotext")
pytestmark = pytest.mark.skipif(
    not all(map(shutil.which, NEEDED)),
    reason="no browser: install chromium, chromium-driver and poppler-utils",
)
TYPED = "<script>document.title='caught'</script> =cmd()"
POINTS_PER_MM = 72 / 25.4
STUDY = EXTENDED.model_copy(
    update={"group": tuple(Group(name=name, size=2) for name in ("young", "<i>old</i>"))}
)


def nasty_sessions() -> list[list[StoredEvent]]:
    """Return sessions with groups, opposite trials, missing scores, and texts with code."""
    rng = np.random.default_rng(2)
    sessions = [
        session_events(EXTENDED, slot, rng, who=who)
        for slot, who in enumerate(("P01", "<b>P02</b>", "参与者-3", "P04"))
    ]
    sessions[0][-1:-1] = [NoteTaken(text=TYPED), TrialExcluded(index=9, reason=TYPED)]
    sessions[3] = [
        replace(event, score=None)
        if isinstance(event, Answered) and event.condition == "pressure"
        else event
        for event in sessions[3]
    ]
    for number, (opened, *_) in enumerate(sessions):
        assert isinstance(opened, SessionOpened)
        sessions[number][0] = replace(opened, group=STUDY.groups[number % 2])
    return [chain(events) for events in sessions]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("report")
    recorded = load_sessions(nasty_sessions())
    found = study_data(recorded, rehearsals=False, rules=STUDY.exclusions)
    write_files(report_files(report(TYPED, found, STUDY, ORIGIN), figures=False), place)
    return place


@pytest.fixture(scope="module")
def browser(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[webdriver.Chrome]:
    with headless_browser(tmp_path_factory.mktemp("profile")) as driver:
        driver.set_window_size(1200, 900)
        driver.get_log("performance")  # type: ignore[no-untyped-call]  # of the browser's own page
        driver.get(f"file://{folder / 'report.html'}")
        yield driver


def test_the_page_makes_no_requests_and_logs_no_errors(browser: webdriver.Chrome) -> None:
    messages = [json.loads(entry["message"])["message"] for entry in browser.get_log("performance")]  # type: ignore[no-untyped-call]
    asked = [
        message["params"]["request"]["url"]
        for message in messages
        if message["method"] == "Network.requestWillBeSent"
    ]
    assert [url.rpartition("/")[2] for url in asked] == ["report.html"]
    assert browser.get_log("browser") == [], "its security policy allows all that it needs"  # type: ignore[no-untyped-call]


def test_typed_texts_are_escaped(browser: webdriver.Chrome) -> None:
    assert browser.title == f"{TYPED}: report"
    assert browser.find_elements(By.TAG_NAME, "script") == []
    for name in ("incidents", "left-out"):
        assert TYPED in str(browser.find_element(By.ID, name).get_property("textContent"))


def test_a_score_links_to_its_trials_and_their_predictions(browser: webdriver.Chrome) -> None:
    cell = browser.find_element(By.CSS_SELECTOR, "#table4 tbody tr:nth-child(2) td:nth-child(4) a")
    score = float(cell.text)
    cell.send_keys("\n")
    target = browser.find_element(By.CSS_SELECTOR, ":target")
    assert target.get_attribute("id") == "trials-2-3"
    visible = (
        "const b = arguments[0].getBoundingClientRect(); return b.top >= 0 && b.top < innerHeight"
    )
    assert browser.execute_script(visible, target)
    rows = target.find_elements(By.XPATH, "./..//tr[th='voltage']")
    cells = [[cell.text for cell in row.find_elements(By.TAG_NAME, "td")] for row in rows]
    scored = [float(row[6]) for row in cells if row[2].startswith("trial") and row[6] != "–"]
    assert np.mean(scored) == pytest.approx(score, abs=0.005)
    told = [row for row in cells if row[2] != "catch"]
    assert all(re.fullmatch(r"−?\d\.\d{4}", text) for row in told for text in row[8:11])


def test_there_is_a_way_back_to_table_4(browser: webdriver.Chrome) -> None:
    browser.find_element(By.CSS_SELECTOR, "#trials-2-3 th a").send_keys("\n")
    assert browser.find_element(By.CSS_SELECTOR, ":target").get_attribute("id") == "cell-2-3"


def test_folded_sections_open_by_keyboard(browser: webdriver.Chrome) -> None:
    section = browser.find_element(By.ID, "h-methods")
    assert section.get_attribute("open") is None
    section.find_element(By.TAG_NAME, "summary").send_keys("\n")
    assert section.get_attribute("open") is not None
    assert section.find_element(By.TAG_NAME, "p").is_displayed()


def test_a_missing_score_links_to_its_trials(browser: webdriver.Chrome) -> None:
    missing = browser.find_elements(By.CSS_SELECTOR, "#table4 td.missing a")
    labels = [cell.get_attribute("aria-label") for cell in missing]
    assert labels == ["3 as expected, 1 no change: its trials"]
    assert browser.find_element(By.ID, "directions")


@pytest.mark.parametrize("width", [1200, 400])
def axe(browser: webdriver.Chrome, width: int) -> list[tuple[str, str]]:
    """Return what axe finds amiss on the page at that width."""
    browser.set_window_size(width, 900)
    browser.execute_script((files("axe_core_python") / "axe.min.js").read_text(encoding="utf-8"))
    found: Any = browser.execute_async_script(
        "const done = arguments[arguments.length - 1]; axe.run().then(done)"
    )
    assert len(found["passes"]) > 15, "axe checked the page"
    return [(entry["id"], entry["nodes"][0]["html"]) for entry in found["violations"]]


@pytest.mark.parametrize("width", [1200, 400])
def test_axe_finds_no_accessibility_violation(browser: webdriver.Chrome, width: int) -> None:
    assert axe(browser, width) == []


@pytest.mark.parametrize("width", [1100, 1160, 1200])
def test_table_4_has_all_of_its_columns_on_a_screen_that_is_hardly_wide_enough(
    browser: webdriver.Chrome, width: int
) -> None:
    # The window's own width, so that the page is narrower by a scroll bar.
    browser.set_window_size(width, 900)
    table = browser.find_element(By.ID, "table4").rect
    shown = browser.execute_script("return document.documentElement.clientWidth")
    assert 0 <= table["x"] < table["x"] + table["width"] <= shown
    words = browser.find_element(By.CSS_SELECTOR, ".results > div").rect
    beside = table["x"] > words["x"]
    assert beside == (width > 1100), "beside the words where it fits, else below them"


def test_only_tables_are_wider_than_a_narrow_screen(browser: webdriver.Chrome) -> None:
    browser.set_window_size(400, 900)
    script = "return document.documentElement.scrollWidth - document.documentElement.clientWidth"
    assert browser.execute_script(script) == 0


def test_the_printed_page_is_legible_and_complete(
    browser: webdriver.Chrome, tmp_path: Path
) -> None:
    options = PrintOptions()
    options.page_width, options.page_height = 21.0, 29.7
    pdf = tmp_path / "report.pdf"
    pdf.write_bytes(base64.b64decode(browser.print_page(options)))
    boxes = subprocess.run(
        ["pdftotext", "-bbox", str(pdf), "-"], capture_output=True, text=True, check=True
    ).stdout
    words = re.findall(
        r'xMin="([\d.-]+)" yMin="[\d.]+" xMax="([\d.]+)" yMax="[\d.]+">(.*?)<', boxes
    )
    assert {"comprehensive", "criterion", "measured", "structure"} <= {w[2] for w in words}
    left, right = (min(float(w[0]) for w in words), max(float(w[1]) for w in words))
    assert left >= 9 * POINTS_PER_MM
    assert right <= (210 - 9) * POINTS_PER_MM
    sizes = re.findall(r'yMin="([\d.]+)" xMax="[\d.]+" yMax="([\d.]+)">[a-z]{3,}<', boxes)
    assert min(float(bottom) - float(top) for top, bottom in sizes) >= 6, "points, in height"


@pytest.mark.parametrize(
    "added",
    [
        "<script>document.title = 'caught'</script>",
        "<img src='figures/scores.png'>",
        "<img src='data:,' onerror=\"document.title = 'caught'\">",
        "<iframe src='report.json'></iframe>",
        "<object data='figures/scores.svg'></object>",
    ],
)
def test_the_page_runs_and_loads_nothing_that_is_put_into_it(
    folder: Path, browser: webdriver.Chrome, added: str
) -> None:
    """Each attempt violates its content security policy."""
    page = (folder / "report.html").read_text(encoding="utf-8")
    (folder / "changed.html").write_text(page.replace("<body>", f"<body>{added}"), encoding="utf-8")
    browser.get(f"file://{folder / 'changed.html'}")
    assert browser.title == f"{TYPED}: report"
    messages = [entry["message"] for entry in browser.get_log("browser")]  # type: ignore[no-untyped-call]
    assert [message for message in messages if "Content Security Policy" in message]
