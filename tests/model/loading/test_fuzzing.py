"""Whatever becomes of a valid file, it is a mesh within the limits or a MeshError that says why.

A long run: `python -m pytest --hypothesis-profile=long tests/model/loading/test_fuzzing.py`.
"""

import pickle

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from meshconv3d.model.errors import MeshError
from meshconv3d.model.loading import Limits, load_mesh
from meshconv3d.model.mesh import Mesh
from tests.hostile.mutations import SEEDS, mutations

LIMITS = Limits(vertices=500, faces=500, geometries=50, values=500)


@pytest.mark.parametrize("title", SEEDS)
@settings(suppress_health_check=[HealthCheck.too_slow])
@given(data=st.data())
def test_a_changed_file_is_a_mesh_or_an_error(title, data):
    seed = SEEDS[title]
    changed = seed.whole(data.draw(mutations(seed.content)))
    outcome = _outcome(changed, seed.extension)
    if isinstance(outcome, Mesh):
        assert len(outcome.faces) <= LIMITS.faces
        assert len(outcome.vertices) <= LIMITS.vertices
        return
    assert outcome.fault != "unreadable", outcome.__cause__
    assert len(str(outcome)) < 500
    again = pickle.loads(pickle.dumps(outcome))
    assert (type(again), again.fault, str(again)) == (type(outcome), outcome.fault, str(outcome))


def _outcome(data: bytes, name: str) -> Mesh | MeshError:
    try:
        return load_mesh(data, name, LIMITS)
    except MeshError as error:
        return error
