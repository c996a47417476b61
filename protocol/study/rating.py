"""The scale of scores: its ends, its ticks and its bands; and the spread expected of scores."""

from typing import Annotated, Literal, Self

from pydantic import ConfigDict, Field, model_validator

from protocol.study.fields import Line, NotNegative, Positive, Record, Whole

Score = Annotated[Whole, Field(le=1_000)]
"""Whole, so that it can be typed and counted."""


class Band(Record):
    """A range of scores, and its name in each language by the language's code."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[
        str, Annotated[Line, Field(description="its name in that language, such as `en`")]
    ] = Field(init=False)

    first: Annotated[Score, Field(alias="from", description="lowest score of the band")]
    last: Annotated[Score, Field(alias="to", description="highest score of the band")]

    @property
    def names(self) -> dict[str, str]:
        """The names that the study file gives, by language."""
        return self.__pydantic_extra__


PAPERS_BANDS = {
    (0, 0): "no effect",
    (1, 4): "very weak",
    (5, 7): "general",
    (8, 10): "very effective",
}
"""The paper's names of its scores (section 5.2): first and last score, and the key in languages."""


class Rating(Record):
    """When and on which scale the effect is scored, and how the scores are named."""

    score_when: Annotated[
        Literal["agrees", "always"],
        Field(description="ask for the score only if the answer agrees with the expectation"),
    ] = "agrees"
    minimum: Annotated[Score, Field(description="lowest score")] = 0
    maximum: Annotated[Score, Field(description="highest score, above the lowest")] = 10
    ticks: Annotated[
        Literal["all", "bands", "ends"], Field(description="which scores are marked on the scale")
    ] = "all"
    bands: Annotated[
        tuple[Band, ...], Field(description="names of ranges, which together cover the scale")
    ] = ()

    @model_validator(mode="after")
    def _ends_are_apart(self) -> Self:
        if self.minimum >= self.maximum:
            raise ValueError(f"maximum must be above minimum = {self.minimum}, got {self.maximum}")
        return self

    @model_validator(mode="after")
    def _bands_cover_the_scale(self) -> Self:
        covered = [score for band in self.bands for score in range(band.first, band.last + 1)]
        if self.bands and covered != list(range(self.minimum, self.maximum + 1)):
            spans = ", ".join(f"{band.first}-{band.last}" for band in self.bands)
            raise ValueError(
                f"bands must follow one another from {self.minimum} to {self.maximum}, got {spans}"
            )
        return self

    @property
    def span(self) -> int:
        """How far the ends of the scale are apart."""
        return self.maximum - self.minimum


PAPERS_SCALE = Rating.model_validate(
    {
        "bands": [
            {"from": first, "to": last, "en": name} for (first, last), name in PAPERS_BANDS.items()
        ]
    }
)
"""From 0 to 10 (section 5.2)."""


class Forecast(Record):
    """Standard deviations of ratings on the paper's scale of 0 to 10, from its Table 4.

    `residual_sd` is that about each person's own line (27 df); the others are M2's medians.
    """

    residual_sd: Annotated[
        Positive,
        Field(le=10, description="SD of a score about the participant's own line, points"),
    ] = 1.48
    off_the_line_sd: Annotated[
        NotNegative,
        Field(
            le=10,
            description="SD between conditions of what they add for everybody beside the "
            "predicted contrast, points",
        ),
    ] = 1.8
    gain_sd: Annotated[
        NotNegative,
        Field(le=1000, description="SD of gains between people, points per unit of contrast"),
    ] = 4.1
