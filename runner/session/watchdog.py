"""The test of the device's watchdog: once a day for each device, with nobody at the beam."""

from dataclasses import replace

from device.errors import DeviceError
from protocol.address import SIMULATED
from protocol.journal.events import WatchdogTested
from runner.session.session import SessionContext
from runner.session.waiting import obey, operator_answer, update_view
from runner.signals import raise_if_stopped

_HANDS_OFF = (
    "The watchdog will be tested; nobody may touch the surface. Press Enter once it is free."
)
NOT_TRIPPED = (
    "the device's watchdog did not trip when the device heard nothing: if this program died, the "
    "output would stay on; have the device repaired"
)


def require_watchdog(context: SessionContext, idn: str) -> None:
    """Test the watchdog of the armed device, unless it has tripped today; record the result.

    The operator first keeps everybody off the beam; a simulated beam is always free. Raises
    `DeviceError` if the watchdog did not trip; the output is off.
    """
    # Another device, or the same one at another port, is tested again.
    tripped = WatchdogTested(tripped=True, idn=idn, address=context.address)
    if not context.device.has_watchdog or _recorded_today(context, tripped):
        return
    if context.address != SIMULATED:
        context.operator.confirm(_HANDS_OFF)
        operator_answer(context)
    hands_off = "testing the watchdog: hands off the surface"
    update_view(context, warning=hands_off, busy="0 V, testing the watchdog")

    def meanwhile() -> None:
        raise_if_stopped()
        context.participant.poll()  # a window that fails must not wait for the end of the test
        # Else an emergency stop would wait for the end of the test.
        obey(context)

    tested = replace(tripped, tripped=context.device.watchdog_trips(meanwhile))
    # Recorded even if it failed, so that the journal tells why the session ended.
    context.log.append(tested)
    update_view(context)
    if not tested.tripped:
        raise DeviceError(NOT_TRIPPED)


def _recorded_today(context: SessionContext, wanted: WatchdogTested) -> bool:
    # The day of the laboratory, not that of UTC, which may change in the middle of a session.
    today = context.clock.utc().astimezone().date()
    tests = context.log.journal.records_of(WatchdogTested)
    return any(utc.astimezone().date() == today and test == wanted for utc, test in tests)
