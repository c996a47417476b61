"""The paper, reproduced: its figures, its Table 4 and its claims under each friction law.

`python -m handbook.paper` (`make paper`) writes docs/paper.md and what is in docs/paper.
"""
