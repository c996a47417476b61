"""What a track asks next, by rules that need no arrays: staircases, limits, constant stimuli.

Public face: `procedure.Answer`, `procedure.moved`, `procedure.start`, `procedure.constant_order`,
`procedure.most_reversals`, `procedure.converges_at`. `device/tracks` adds QUEST+ to them.
"""
