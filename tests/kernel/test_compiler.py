"""Two kinds of compiled code: of one film, and no business of a user's own functions."""

import os
import subprocess
import sys

import numba
import numpy as np
import pytest

from paint_deposition.kernel.compiler import KINDS, kinds_at_hand, njit

# Writes a film on a wall before the gun to the standard output.
FILM = """
import sys
import numpy as np
import paint_deposition as pd
from paint_deposition.effects.catalogue import EFFECTS
from paint_deposition.film.integrator import FilmIntegrator
from paint_deposition.motion.path_builder import spray_path
from paint_deposition.part.points import SurfacePoints

motion = pd.read_recording(pd.sample_folder() / 'door_horizontal', state_topic='/atomizer/state')
x, z = np.meshgrid(np.linspace(-0.5, 0.5, 60), np.linspace(-0.4, 0.4, 50))
wall = np.stack([x.ravel(), 0.0 * x.ravel(), z.ravel()], axis=1)
points = SurfacePoints(wall, np.tile([0.0, -1.0, 0.0], (len(wall), 1)))
model = pd.DepositionModel().with_effect(EFFECTS['standoff_efficiency'].typical())
film_um = FilmIntegrator(points, model).raw_of(spray_path(motion)[0])
assert film_um.max() > 10.0
sys.stdout.buffer.write(film_um.tobytes())
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
