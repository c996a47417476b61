"""The wire protocol's page: its examples run, and it names every command, error and fault."""

import re
from array import array
from collections.abc import Iterator
from pathlib import Path

import pytest

from device.force_channel.recording import Block, decoded, encoded
from device.gauges.gauge import LineGauge
from device.gauges.gauge import block as samples_in
from device.link.codec import block, number
from device.link.link import Link, open_link
from device.simulator.client import ControlClient, Endpoints, simulator_process
from device.simulator.device import SimulatedDevice
from device.simulator.faults import FAULTS
from device.simulator.hardware.force_sampler import SCALE
from handbook.reference import faults_page
from tests.device.rigs import TOUCHBEAM

pytestmark = pytest.mark.waits

PAGE = (Path(__file__).parents[2] / "docs" / "reference" / "wire-protocol.md").read_text(
    encoding="utf-8"
)
SOURCES = Path(__file__).parents[2] / "device" / "simulator"
EXAMPLES = re.findall(r"```scpi\n(.*?)```", PAGE, re.DOTALL)


@pytest.fixture(scope="module")
def simulator() -> Iterator[Endpoints]:
    with simulator_process(TOUCHBEAM, seed=1, keep=True) as endpoints:
        yield endpoints


@pytest.fixture(scope="module")
def link(simulator: Endpoints) -> Iterator[Link]:
    link = open_link(simulator.url)
    yield link
    link.close()


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda text: text.split("\n")[0][2:30])
def test_an_example_of_the_page_runs_as_printed(
    example: str, simulator: Endpoints, link: Link
) -> None:
    """`>` is sent, `(` is the hand.

    `<` is the whole answer (`~`: a number and its tolerance), `#` the header of a block of samples.
    """
    lines = example.splitlines()
    with ControlClient(simulator.control) as control:
        control.reset()
        for line, after in zip(lines, [*lines[1:], ""], strict=True):
            mark, text = line[0], line[2:]
            if mark == "(":
                control._ask(text)
            elif mark == ">" and after.startswith("<"):
                _agrees(link.ask(text), after[2:])
            elif mark == ">" and after.startswith("#"):
                found = link.block(text, decoded)
                assert f"{found.first} {found.count} {int(found.lost)}" == after[2:]
            elif mark == ">":
                link.tell(text)
                assert link.ask("*OPC?") == "1", "done before the hand does anything"
            assert mark in "><(#", line


@pytest.mark.parametrize("example", re.findall(r"```gauge\n(.*?)```", PAGE, re.DOTALL))
def test_an_example_of_the_gauge_runs_as_printed(example: str, simulator: Endpoints) -> None:
    gauge = LineGauge(open_link(simulator.gauge))
    lines = example.splitlines()
    with ControlClient(simulator.control) as control:
        for line, after in zip(lines, [*lines[1:], ""], strict=True):
            mark, text = line[0], line[2:]
            if mark == "(":
                control._ask(text)
            elif mark == ">" and after.startswith("<"):
                assert gauge.link.ask(text) == after[2:]
            elif mark == ">" and after.startswith("#"):
                found = samples_in(gauge.link.ask(text), SCALE)
                assert f"{found.first} {found.count}" == after[2:]
            elif mark == ">":
                gauge.link.tell(text)
                assert gauge.link.ask("UNIT?") == "N", "done before the hand does anything"
    gauge.close()


def test_the_page_has_a_gauges_samples_to_the_byte() -> None:
    printed = re.search(r"```text\n(7;.*?)\n```", PAGE)
    assert printed is not None
    found = samples_in(printed[1], SCALE)
    assert (found.first, found.first_s) == (7, 1.5)
    assert list(found.counts) == [800, 2000, 8280, -3, 2004, 8282]


def _agrees(answer: str, printed: str) -> None:
    if not printed.startswith("~"):
        assert answer == printed
        return
    wanted, off = printed.removeprefix("~").split()
    assert number(answer) == pytest.approx(float(wanted), abs=float(off))


def test_the_page_has_a_block_to_the_byte() -> None:
    printed = re.search(r"```text\n(23 .*?)```", PAGE, re.DOTALL)
    assert printed is not None
    sent = bytes.fromhex(printed[1].replace("\n", " "))
    counts = array("h", (800, 2000, 8280, -3, 2004, 8281))
    assert sent == block(encoded(Block(first=7, first_s=1.5, counts=counts))) + b"\n"


def test_the_page_has_every_header_of_the_board() -> None:
    text = PAGE.replace("[1]", "#").replace("…", "")
    known = [pattern for pattern, _ in _headers()]
    assert len(known) > 40
    spelled = re.findall(r"[*A-Za-z:\[\]#]+", text)
    upper = {re.sub(r"[\[\]#]", "", word).upper() for word in spelled}
    for pattern in known:
        assert any(re.fullmatch(pattern.removesuffix(r"\?"), word) for word in upper), pattern


def _headers() -> list[tuple[str, object]]:
    dialect = SimulatedDevice(seed=1).dialect
    headers = dialect._headers  # nobody else needs to see them
    return [(pattern.pattern, handler) for pattern, handler in headers._handlers]


def test_the_page_has_every_error_number() -> None:
    code = "".join(path.read_text(encoding="utf-8") for path in SOURCES.glob("*.py"))
    raised = set(re.findall(r"ScpiError\((-\d+)", code)) | {"-350"}
    generators_only = {"-151", "-211"}
    assert raised - generators_only <= set(re.findall(r"^\| (-\d+) \|", PAGE, re.MULTILINE))


def test_the_list_of_faults_has_every_number() -> None:
    listed = re.findall(r"^- (\d+) (?:`([a-z-]+)`: )?(.+)$", faults_page(), re.MULTILINE)
    assert {(str(f.number), f.name, f.what) for f in FAULTS} <= set(listed)
    assert {int(number) for number, _, _ in listed} == set(range(1, 37))
