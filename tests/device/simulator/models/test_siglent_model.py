"""The simulated Siglent generator, by the examples of the maker's programming guide."""

import pytest

from device.simulator.device import SimulatedDevice


@pytest.fixture
def device() -> SimulatedDevice:
    device = SimulatedDevice(seed=1, wall_s=lambda: 0.0, dialect="siglent")
    device.answer("*RST", 0.0)
    return device


def told(device: SimulatedDevice, *lines: str) -> str | None:
    answers = [device.answer(line, 0.0) for line in lines]
    assert not any(answers[:-1]), "only a query is answered"
    return answers[-1]


SINE = "C1:BSWV WVTP,SINE,FRQ,100HZ,PERI,0.01S,AMP,2V,OFST,0V,HLEV,1V,LLEV,-1V,PHSE,0"


@pytest.mark.parametrize(
    ("lines", "answer"),
    [
        (["*OPC?"], "1"),
        (["C1:OUTP?"], "C1:OUTP OFF,LOAD,HZ,PLRT,NOR"),
        (["C1:OUTP ON", "C1:OUTP?"], "C1:OUTP ON,LOAD,HZ,PLRT,NOR"),
        (["C1:OUTP LOAD,50", "C1:OUTP?"], "C1:OUTP OFF,LOAD,50,PLRT,NOR"),
        (["C1:OUTP ON,LOAD,HZ,PLRT,INVT", "C1:OUTP?"], "C1:OUTP ON,LOAD,HZ,PLRT,INVT"),
        (["C2:OUTP ON", "C1:OUTP?"], "C1:OUTP OFF,LOAD,HZ,PLRT,NOR"),
        (["C1:BSWV FRQ,100", "C1:BSWV AMP,2", "C1:BSWV?"], SINE),
        (["C1:BSWV WVTP,SINE,FRQ,100HZ,AMP,2V,OFST,0V", "C1:BsWv?"], SINE),
        (["C1:MDWV?"], "C1:MDWV STATE,OFF"),
        (["C1:SWWV?"], "C1:SWWV STATE,OFF"),
        (["C1:BTWV?"], "C1:BTWV STATE,OFF"),
        (["C1:HARM?"], "C1:HARM HARMSTATE,OFF"),
        (["C1:CMBN ON", "C1:CMBN?"], "C1:CMBN ON"),
        (["COUP?"], "COUP TRACE,OFF,FCOUP,OFF,PCOUP,OFF,ACOUP,OFF"),
        (["C1:BSWV WVTP,SQUARE", "C1:HARM?"], None),
        (["SYST:ERR?"], None),
    ],
    ids=lambda value: value[-1] if isinstance(value, list) else "",
)
def test_an_example_of_the_guide(
    device: SimulatedDevice, lines: list[str], answer: str | None
) -> None:
    assert told(device, *lines) == answer


def test_modulation_tells_its_type_and_its_carrier(device: SimulatedDevice) -> None:
    answer = told(device, "C1:MDWV STATE,ON", "C1:MDWV?") or ""
    assert answer.startswith("C1:MDWV STATE,ON,FM,SRC,INT,CARR,WVTP,SINE,FRQ,1000HZ,")


@pytest.mark.parametrize("other", ["SWWV", "BTWV"])
def test_only_one_of_modulation_sweep_and_burst_is_on(device: SimulatedDevice, other: str) -> None:
    told(device, "C1:MDWV STATE,ON", f"C1:{other} STATE,ON")
    assert device.answer("C1:MDWV?", 0.0) == "C1:MDWV STATE,OFF"
    told(device, "C1:BSWV WVTP,SINE")
    assert device.answer(f"C1:{other}?", 0.0) == f"C1:{other} STATE,OFF", "a new wave ends it"


@pytest.mark.parametrize(("put", "kept"), [("0.001", "AMP,0.004V"), ("50", "AMP,20V")])
def test_what_is_out_of_range_is_clipped_without_a_word(
    device: SimulatedDevice, put: str, kept: str
) -> None:
    assert kept in (told(device, f"C1:BSWV AMP,{put}", "C1:BSWV?") or "")


def test_a_load_of_50_ohm_halves_what_is_shown_and_not_what_comes(device: SimulatedDevice) -> None:
    answer = told(device, "C1:BSWV AMP,5", "C1:OUTP ON", "C1:OUTP LOAD,50", "C1:BSWV?") or ""
    assert "AMP,2.5V" in answer
    assert device.instrument.output_v == pytest.approx(50)
