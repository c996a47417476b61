"""The levels of tracks, where arrays are needed: QUEST+, voltages of contrasts, expectations.

Public face: `next_level.next_level`, `next_level.Answer`, `posterior.estimate`,
`expected.expected`, `contrast.voltages`.
"""
