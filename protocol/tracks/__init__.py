"""What a track asks next, by rules that need no arrays: staircases, limits, constant stimuli.

Public face: `rules.Answer`, `rules.moved`, `rules.start`, `rules.constant_order`,
`rules.most_reversals`, `convergence.converges_at`. `device/tracks` adds QUEST+ to them.
"""
