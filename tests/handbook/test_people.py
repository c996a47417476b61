"""The files of people in docs/people.md."""

from pathlib import Path

from device.people.people_file import people_in
from device.people.person import DEFAULT

PAGE = (Path(__file__).parents[2] / "docs" / "people.md").read_text(encoding="utf-8")


def test_the_files_on_the_page_can_be_used() -> None:
    files = [part.partition("```")[0] for part in PAGE.split("```toml\n")[1:]]
    one, population, grouped, effects = map(people_in, files)
    assert effects.effect == {"frequency": 3.0, "pressure": -1.0}
    assert grouped.of_group("old").typical.felt_noise == 0.2
    assert (one.typical.gain, one.varied) == (5.0, {})
    assert set(population.varied) == set(DEFAULT.varied)
    assert people_in("[population]\n") == DEFAULT
