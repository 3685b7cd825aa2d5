"""Changes of a mesh that training copies do not have."""

import numpy as np

from benchmarks.robustness import as_soup, inverted, with_stray_part
from meshconv3d.model.preparation import prepare
from tests.meshes import torus


def test_rewritings_keep_the_surface():
    mesh = torus()
    soup = as_soup(mesh)
    assert len(soup.vertices) == 1500
    assert prepare(soup, 500)[1].vertices_merged == 1250
    assert prepare(inverted(mesh), 500)[1].flipped == 500
    assert prepare(with_stray_part(mesh, np.random.default_rng(5)), 500)[1].components == 2
