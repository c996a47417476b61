"""The page of survivors: what no test finds, and why that may be so."""

from tests.mutants.mutation import ROOT

PAGE = ROOT / "tests/mutants/survivors.md"
OPEN = "not explained yet"
_HEAD = """# Small errors that no test finds

Written by `make mutants`; what stands below each change is written by hand, and is kept. A change
that changes nothing that anybody could see is *equivalent*.
"""


def record(path: str, titles: list[str], *, tried: int, of: int) -> None:
    """Write the survivors of a module; those that were explained stay so."""
    sections = _sections()
    reasons = _reasons(sections.get(path, ""))
    drawn = "" if tried == of else f", drawn from {of}"
    lines = [f"{tried - len(titles)} of {tried} changes are found{drawn}.", ""]
    for title in titles:
        lines += [f"- `{title}`", f"  {reasons.get(title, OPEN)}"]
    sections[path] = "\n".join(lines).strip()
    pages = [_HEAD, *(f"## {name}\n\n{text}\n" for name, text in sorted(sections.items()))]
    PAGE.write_text("\n".join(pages), encoding="utf-8")


def unexplained() -> int:
    """Return how many survivors have no reason."""
    return sum(text.count(f"\n  {OPEN}") for text in _sections().values())


def _sections() -> dict[str, str]:
    if not PAGE.exists():
        return {}
    _, *parts = PAGE.read_text(encoding="utf-8").split("\n## ")
    return {part.partition("\n")[0]: part.partition("\n")[2].strip() for part in parts}


def _reasons(section: str) -> dict[str, str]:
    items = section.split("\n- `")[1:]
    split = (item.partition("`\n  ") for item in items)
    return {title: reason.strip() for title, _, reason in split}
