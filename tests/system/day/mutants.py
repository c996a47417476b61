"""Mutants: how many small errors in the code that guards data and finger do simulated days find?

`python -m tests.system.day.mutants` draws mutants by a fixed seed, a hundred that ordinary tests
find, and runs days with each until one breaks an invariant. It goes on where it was stopped: with
more seeds, only those that survived are tried again.
"""

import argparse
import hashlib
import json
import signal

from tests.mutants import hook
from tests.mutants.forks import KEPT, OUTPUT, exit_code
from tests.mutants.mutation import ROOT, Mutant, mutants
from tests.mutants.run import Results, found_by_tests

SOURCES = (
    "runner/session/loop.py",
    "protocol/journal/state.py",
    "device/drivers/driver.py",
    "device/drivers/board.py",
    "device/drivers/limits.py",
    "runner/journal/store.py",
    "runner/journal/database.py",
    "runner/journal/amendments.py",
)
SEED = 2026
A_DAY_S = 30
"""A day that takes the processor for longer does not end."""
_STANDS_S = 600
"""Nor does one that takes this long on a machine that is busy with other things."""
_FOUND = 3


def found_by_days(mutant: Mutant, seeds: range) -> str:
    """Return how the days find `mutant`, empty if they do not."""
    code = exit_code(lambda: _days(mutant.name, seeds), _STANDS_S + 10.0 * len(seeds))
    if code == 0:
        return ""
    said = OUTPUT.read_text(encoding="utf-8", errors="replace").strip().splitlines()
    return said[-1] if said and code > 0 else f"a day does not end ({code})"


def _days(name: str, seeds: range) -> int:
    """Run days with a mutant until one fails."""
    hook.install(name)
    from tests.system.day.day import day

    for seed in seeds:
        signal.setitimer(signal.ITIMER_PROF, A_DAY_S)
        signal.alarm(_STANDS_S)
        try:
            day(seed)
        except BaseException as error:  # whatever it is, the mutant is found
            what = [*str(error).splitlines(), ""][0][:150]
            print(f"\nseed {seed}: {type(error).__name__}: {what}", flush=True)
            return _FOUND
    return 0


class _Tried:
    """How each mutant fared in the days so far; kept as long as its module stays as it was."""

    def __init__(self) -> None:
        self._file = KEPT / "days.json"
        self._kept: dict[str, list[str | int]] = (
            json.loads(self._file.read_text()) if self._file.exists() else {}
        )

    def of(self, mutant: Mutant) -> tuple[str, int]:
        """Return how it was found, if it was, and how many seeds were tried."""
        how, seeds = self._kept.get(_key(mutant), ["", 0])
        return str(how), int(seeds)

    def add(self, mutant: Mutant, how: str, seeds: int) -> None:
        """Keep how it fared."""
        self._kept[_key(mutant)] = [how, seeds]
        self._file.write_text(json.dumps(self._kept, indent=1), encoding="utf-8")


def _key(mutant: Mutant) -> str:
    digest = hashlib.sha256((ROOT / mutant.path).read_bytes()).hexdigest()[:12]
    return f"{mutant.path} {digest} {mutant.title}"


def _lot(mutant: Mutant) -> str:
    """What the draw goes by: an edit elsewhere leaves the lot of a mutant as it is."""
    return hashlib.sha256(f"{SEED} {mutant.path} {mutant.title}".encode()).hexdigest()


def drawn(count: int) -> list[Mutant]:
    """Return so many mutants of `SOURCES`, drawn by a seed from those that ordinary tests find."""
    every = [mutant for path in SOURCES for mutant in mutants(path)]
    every.sort(key=_lot)
    results = {path: Results(path) for path in SOURCES}
    found: list[Mutant] = []
    for mutant in every:
        if len(found) < count and found_by_tests(mutant, results[mutant.path]):
            found.append(mutant)
    return found


def main() -> None:
    """Draw mutants, run days with each, and list those that survive."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--seeds", type=int, default=500)
    parser.add_argument("--again", action="store_true", help="try survivors from the first seed")
    options = parser.parse_args()
    tried, survivors = _Tried(), 0
    chosen = drawn(options.count)
    for mutant in chosen:
        how, seeds = tried.of(mutant)
        seeds = 0 if options.again else seeds
        if not how and seeds < options.seeds:
            how = found_by_days(mutant, range(seeds, options.seeds))
            tried.add(mutant, how, options.seeds)
        survivors += not how
        print(f"{mutant}\n    {how or 'SURVIVES'}", flush=True)
    print(f"{len(chosen) - survivors} of {len(chosen)} found by {options.seeds} days")


if __name__ == "__main__":
    main()
