"""The simulated Rigol generators, by the examples of the maker's programming guides."""

import pytest

from device.simulator.device import SimulatedDevice


@pytest.mark.parametrize(
    ("lines", "answer"),
    [
        ([":OUTP1?"], "OFF"),
        ([":OUTP1 ON", ":OUTPut1:STATe?"], "ON"),
        ([":OUTP1:LOAD 100", ":OUTP1:IMP?"], "1.000000E+02"),
        ([":OUTP1:IMP INF", ":OUTP1:LOAD?"], "9.900000E+37"),
        ([":OUTP1:VOLLimit?"], "OFF"),
        ([":OUTP1:LOAD INF", ":OUTP1:VOLLimit ON", ":OUTP1:VOLLimit?"], "ON"),
        ([":OUTP1:VOLLimit:LOW -1", ":OUTP1:VOLLimit:LOW?"], "-1.000000E+00"),
        ([":OUTP1:LOAD INF", ":SOUR1:VOLT 5", ":SOUR1:VOLT?"], "5.000000E+00"),
        ([":SOUR1:FREQ 24221.37", ":SOUR1:FREQ?"], "2.422137E+04"),
        ([":SOUR1:MOD ON", ":MOD?"], "ON"),
        ([":SOUR1:HARM?"], "OFF"),
        ([":SOUR1:SUM?"], "OFF"),
        ([":SOUR1:BURS?"], "OFF"),
        ([":SOUR1:SWE:STAT?"], "OFF"),
        ([":SYST:ERR?"], '0,"No error"'),
        (
            [":OUTP1:LOAD INF", ":SOUR1:APPL:SIN 1000,5,0,90", ":SOUR1:APPL?"],
            '"SIN,1.000000E+03,5.000000E+00,0.000000E+00,9.000000E+01"',
        ),
        ([":OUTP1:LOAD INF", ":SOUR1:APPL:DC 1,1,2", ":SOUR1:VOLT:OFFS?"], "2.000000E+00"),
    ],
    ids=lambda value: value[-1] if isinstance(value, list) else "",
)
def test_an_example_of_the_guide(lines: list[str], answer: str) -> None:
    device = SimulatedDevice(seed=1, wall_s=lambda: 0.0, dialect="rigol")
    assert [device.answer(line, 0.0) for line in lines][-1] == answer


def test_a_wave_that_is_applied_leaves_the_output_as_it_is() -> None:
    device = SimulatedDevice(seed=1, wall_s=lambda: 0.0, dialect="rigol")
    device.answer(":SOUR1:APPL:SIN 1000,5,0,0", 0.0)
    assert device.answer(":OUTP1?", 0.0) == "OFF"


def test_a_dg1000z_has_no_limits() -> None:
    device = SimulatedDevice(seed=1, wall_s=lambda: 0.0, dialect="rigol-DG1062Z")
    assert device.answer(":OUTP1:VOLL?", 0.0) is None
    assert device.answer(":SYST:ERR?", 0.0) == '-113,"Undefined header"'
