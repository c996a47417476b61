"""The terms of the report, each in a sentence or two, for readers of other fields."""

from analysis.report.blocks import Definitions, Section
from analysis.report.findings import Findings
from device.friction.laws import LAWS

_TERMS = {
    "95% CI": "confidence interval, or for M1 to M3 the interval that holds the value with a "
    "probability of 95%, given the model.",
    "bias": "the rating that a subject gives where no change of friction is predicted.",
    "contrast": "predicted change of friction, as a difference of natural logarithms: .10 is a "
    "change of about 10%. It is positive if friction changes as the study expects. At a place: "
    "friction there before and after. Over a path: root mean square difference along the way. "
    "Growth of a swing: how much more friction varies along the way than before.",
    "d′": "how well a change is noticed: the contrast over the noise in a subject's perception.",
    "gain": "rating points per unit of contrast: a subject's sensitivity.",
    "Holm's correction": "p-values of several tests, raised so that the chance of any false "
    "difference stays below 5%.",
    "JND": "just noticeable difference, by ratings: the contrast that moves a rating by one "
    "standard deviation of its noise, which is that deviation over the gain. It is no threshold "
    "of a psychometric function: nobody compared two changes.",
    "Kendall's W": "agreement of the subjects' rankings: 0 none, 1 perfect.",
    "law": "how friction follows from vibration. {laws}: printed is the paper's law as it "
    "stands, consistent repairs it so that it has the right limits, coulomb cannot exceed "
    "Coulomb's friction.",
    "M1, M2, M3": "models of the ratings. M1 is a straight line per subject. M2, the headline, "
    "adds steps of the scale, its ceiling, and what conditions have beyond their contrast. M3 "
    "first models whether a change is noticed.",
    "own share": "how much of what is said of a subject comes from the subject's own trials; "
    "the rest is borrowed from the group.",
    "p": "probability of scores at least as different as these if conditions made no difference.",
    "r": "rank-biserial correlation: 1 if every subject whose ratings differ rated the first "
    "condition higher. Its interval is for this pair alone; p is corrected for all pairs.",
    "relative gain": "a subject's gain less the mean gain of all subjects.",
    "rung": "how the beam's motion is computed; the top rung is the most accurate.",
}


def glossary(_: Findings) -> Section:
    """Return the terms in alphabetical order."""
    entries = {name: text.replace("{laws}", ", ".join(LAWS)) for name, text in _TERMS.items()}
    in_order = sorted(entries.items(), key=lambda entry: entry[0].casefold())
    return Section(name="glossary", title="Glossary", blocks=[Definitions(entries=dict(in_order))])
