"""Two kinds of compiled code: of one film, and no business of a user's own functions."""

import os
import subprocess
import sys

import numba
import numpy as np
import pytest

from paint_deposition.kernel.compiler import KINDS, kinds_at_hand, njit

# Writes a film to the standard output.
FILM = """
import sys
import paint_deposition as pd
from paint_deposition.effects.catalogue import EFFECTS

samples = pd.sample_folder()
door = pd.read_mesh(samples / 'door.stl', max_edge_length_m=0.02)
motion = pd.read_recording(samples / 'door_horizontal', state_topic='/atomizer/state')
model = pd.DepositionModel().with_effect(EFFECTS['standoff_efficiency'].typical())
sys.stdout.buffer.write(pd.simulate(door, motion, model).film_um.tobytes())
"""


@pytest.mark.slow
def test_one_film_from_code_compiled_now_or_before_and_nearly_so_for_another_processor(tmp_path):
    films_um = {}
    for kind in kinds_at_hand():
        environment = os.environ | {'NUMBA_CPU_NAME': kind, 'NUMBA_CACHE_DIR': str(tmp_path)}
        command = [sys.executable, '-c', FILM]
        first, again = (
            subprocess.run(command, env=environment, capture_output=True, check=True).stdout
            for _ in range(2)
        )
        assert first == again
        films_um[kind] = np.frombuffer(first)
    if len(films_um) == len(KINDS):  # the processor has AVX-512
        new, old = films_um.values()
        # A unit in the last place of single precision is 1.2e-7.
        assert 0.0 < np.abs(new - old).max() < 2e-7 * old.max()


def test_a_users_own_functions_are_compiled_for_the_processor_at_hand():
    theirs, ours = numba.njit(lambda x: x + 1.0), njit(lambda x: x + 1.0)
    assert theirs(1.0) == ours(1.0) == 2.0
    kinds = [one.targetctx.codegen().magic_tuple()[1] for one in (theirs, ours)]
    assert kinds[1] in KINDS
    assert numba.config.CPU_NAME is None
    assert kinds[0] not in KINDS
