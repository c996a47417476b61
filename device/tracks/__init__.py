"""The levels of tracks: QUEST+, the voltages of contrasts, what a track can be expected to tell."""
