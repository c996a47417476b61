"""Python imports this as it starts, where the environment of `tests.mutants.hook` says so."""

import os

from tests.mutants import hook

if hook.VARIABLE in os.environ:
    hook.install(os.environ[hook.VARIABLE])
