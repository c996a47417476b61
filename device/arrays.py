"""Types of arrays: what their elements are.

A signature says with them what a function computes with; its docstring gives the shape, as `(n,)`
or `(places, modes)`, and the unit. `n` stands for any number, also 0.

    FloatArray    quantities and ratios, NaN where there is none
    ComplexArray  amplitudes with their phase
    BoolArray     answers to a question about each element
    IndexArray    places in another array, also -1 for none

The same types serve all of `device`, so that an array goes from the beam's motion to the friction
under a finger, to the person who feels it, without a conversion. Tables of people and studies are
data frames, which only `analysis` has.
"""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

ComplexArray = NDArray[np.complex128]

BoolArray = NDArray[np.bool_]

IndexArray = NDArray[np.intp]
