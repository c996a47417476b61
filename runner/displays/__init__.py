"""The screens of this computer.

Public face: `screen_list.listed_screens`, `screen_list.numbered_screens`,
`screen_list.print_screens`.
"""
