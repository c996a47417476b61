"""The documentation's site in a browser without a network, opened as files."""

import json
import re
import shutil
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
from axe_core_python.selenium import Axe  # type: ignore[import-untyped]
from selenium import webdriver
from selenium.common.exceptions import TimeoutException
from selenium.webdriver import ActionChains
from selenium.webdriver.support.wait import WebDriverWait

from handbook.build import ROOT, build_in
from tests.headless_browser import PROGRAMS, headless_browser

pytestmark = pytest.mark.skipif(
    not all(map(shutil.which, PROGRAMS)), reason="no browser: install chromium and chromium-driver"
)
# Of each kind one: text, outputs, wide tables, pictures, definitions, generated pages.
LOOKED_AT = (
    "index.html",
    "tutorials/first-study.html",
    "annotated-study.html",
    "cookbook.html",
    "architecture.html",
    "study-file.html",
    "rig.html",
    "glossary.html",
    "reference/statistics.html",
    "mathematics/beam.html",
)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_in(tmp_path_factory.mktemp("documentation"))


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[webdriver.Chrome]:
    with headless_browser(tmp_path_factory.mktemp("profile")) as driver:
        yield driver


def opened(browser: webdriver.Chrome, page: Path, width: int) -> None:
    size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": False}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    browser.get(f"file://{page}")


def asked(browser: webdriver.Chrome) -> list[str]:
    """The addresses that pages asked for since the last time."""
    messages = [json.loads(entry["message"])["message"] for entry in browser.get_log("performance")]  # type: ignore[no-untyped-call]
    return [
        message["params"]["request"]["url"]
        for message in messages
        if message["method"] == "Network.requestWillBeSent"
    ]


def violations(browser: webdriver.Chrome) -> list[tuple[str, str]]:
    """What axe finds on the page, and whether it scrolls sideways."""
    found = Axe().run(browser)["violations"]
    listed = [(rule["id"], node["html"][:200]) for rule in found for node in rule["nodes"]]
    if browser.execute_script("return document.documentElement.scrollWidth > innerWidth"):
        listed.append(("scrolls sideways", ""))
    return listed


@pytest.mark.parametrize("width", [1200, 400])
@pytest.mark.parametrize("name", LOOKED_AT)
def test_a_page_can_be_used_by_everybody(
    browser: webdriver.Chrome, site: Path, name: str, width: int
) -> None:
    opened(browser, site / name, width)
    assert violations(browser) == []


@pytest.mark.soak
def test_every_page_can_be_used_by_everybody(browser: webdriver.Chrome, site: Path) -> None:
    found = {}
    for page in site.rglob("*.html"):
        for width in (1200, 400):
            opened(browser, page, width)
            found[str(page.relative_to(site)), width] = violations(browser)
    assert len(found) > 2 * len(LOOKED_AT)
    assert {where: what for where, what in found.items() if what} == {}


def test_no_page_asks_the_network_for_anything(browser: webdriver.Chrome, site: Path) -> None:
    asked(browser)
    for name in LOOKED_AT:
        opened(browser, site / name, 1200)
    found = asked(browser)
    assert found
    assert [url for url in found if not url.startswith(("file:", "data:", "blob:"))] == []
    assert browser.get_log("browser") == []  # type: ignore[no-untyped-call]


def test_no_page_names_a_script_or_a_style_of_another_place(site: Path) -> None:
    for page in site.rglob("*.html"):
        text = page.read_text(encoding="utf-8")
        assert 'src="http' not in text
        assert 'rel="stylesheet" href="http' not in text


def test_every_formula_is_drawn_with_its_number(site: Path) -> None:
    for source in sorted((ROOT / "docs" / "mathematics").glob("*.md")):
        numbers = re.findall(r"\\tag\{(\d+)\}", source.read_text(encoding="utf-8"))
        assert numbers == [str(k) for k in range(1, len(numbers) + 1)], source.name
        assert source.read_text(encoding="utf-8").count("```math") == len(numbers)
        page = (site / "mathematics" / f"{source.stem}.html").read_text(encoding="utf-8")
        drawn = re.findall(r"<math .*?</math>", page)
        assert len(drawn) == len(numbers)
        for formula in drawn:
            text = "".join(ET.fromstring(formula).itertext())
            assert "\\" not in text, f"{source.name}: not drawn: {text}"


def test_the_search_finds_a_word_that_is_typed_on_a_page_opened_as_a_file(
    browser: webdriver.Chrome, site: Path
) -> None:
    opened(browser, site / "index.html", 1200)
    wait = WebDriverWait(browser, 90)
    wait.until(search_opens, "the search does not open")
    for typed in ("vibro", "meter"):
        ActionChains(browser).send_keys(typed).perform()
        wait.until(lambda browser: "result" in shown(browser))
    wait.until(lambda browser: "The resonance with a generator" in shown(browser))
    assert entry(browser) == "vibrometer"


@pytest.mark.parametrize(
    ("word", "heading"),
    [
        ("Likert", "A 7-point scale (Likert)"),
        ("VAS", "A visual analogue scale (VAS)"),
        ("Excel", "My ratings are in Excel"),
        ("randomise", "Randomise, counterbalance, Latin square"),
        ("counterbalance", "Randomise, counterbalance, Latin square"),
        ("Latin square", "Randomise, counterbalance, Latin square"),
        ("latency", "Timing accuracy"),
        ("EEG", "EEG, or LSL markers"),
        ("LSL", "EEG, or LSL markers"),
        ("JND", "A threshold: staircase, 2AFC, JND"),
        ("staircase", "A threshold: staircase, 2AFC, JND"),
        ("2AFC", "A threshold: staircase, 2AFC, JND"),
        ("PsychoPy", "I know PsychoPy"),
        ("masking noise", "Masking noise"),
    ],
)
def test_what_people_search_for_is_found(
    browser: webdriver.Chrome, site: Path, word: str, heading: str
) -> None:
    opened(browser, site / "index.html", 1200)
    wait = WebDriverWait(browser, 90)
    wait.until(search_opens, "the search does not open")
    ActionChains(browser).send_keys(word).perform()
    wait.until(lambda browser: heading in shown(browser))


SEARCH = "[...document.querySelectorAll('*')].find(e => e.shadowRoot)?.shadowRoot"


def search_opens(browser: webdriver.Chrome) -> bool:
    """Click on the search, as often as needed: its script may still be on its way."""
    browser.execute_script(
        "document.getElementById('__search').checked = false;"
        "document.querySelector('label[for=__search]').click()"
    )
    with suppress(TimeoutException):
        return WebDriverWait(browser, 5).until(lambda browser: entry(browser) == "")
    return False


def entry(browser: webdriver.Chrome) -> str | None:
    """What the search's field holds while it has the focus."""
    return browser.execute_script(f"return {SEARCH}?.activeElement?.value")  # type: ignore[no-any-return]


def shown(browser: webdriver.Chrome) -> str:
    """What the search shows."""
    return str(browser.execute_script(f"return {SEARCH}.textContent"))
