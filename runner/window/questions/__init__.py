"""Questions in the participant's window: their pages, and what inputs make of an answer.

The parts that all pages have in common are here, too.

Public face: `question_pages.question_page`, `question_pages.question_targets`,
`question_pages.Choice`.
"""
