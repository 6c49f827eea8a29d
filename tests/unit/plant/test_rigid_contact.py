"""Rigid contacts against their equations, written out with numpy."""

import numpy as np
import pytest

from template_control.plant.rigid_contact import pressing, solve

NV = 7


@pytest.fixture
def system():
    """M, right-hand side, Jacobian and gamma of a robot's size."""
    rng = np.random.default_rng(3)
    root = rng.normal(size=(NV, NV))
    mass_matrix = np.asfortranarray(root @ root.T + np.eye(NV))
    return mass_matrix, rng.normal(size=NV), rng.normal(size=(2, 2, NV)), rng.normal(size=(2, 2))


@pytest.mark.parametrize("held", [(), (0,), (1,), (0, 1)])
def test_motion_and_forces_obey_both_equations(system, held):
    mass_matrix, right, jacobian, gamma = system
    x, force = solve(*system, held)
    pull = np.einsum("fij,fi->j", jacobian, force)
    np.testing.assert_allclose(mass_matrix @ x, right + pull, atol=1e-12)
    for foot in range(2):
        if foot in held:
            np.testing.assert_allclose(jacobian[foot] @ x, -gamma[foot], atol=1e-12)
        else:
            assert not force[foot].any()


def test_rows_that_depend_on_each_other_determine_no_forces(system):
    _, right, jacobian, gamma = system
    jacobian[1] = jacobian[0] = np.eye(NV)[:2]
    with pytest.raises(np.linalg.LinAlgError, match="depend on each other"):
        solve(np.asfortranarray(np.eye(NV)), right, jacobian, gamma, (0, 1))


def test_a_foot_that_would_pull_is_let_go():
    """One coordinate lifts foot 0 and presses foot 1: as many as can press are held."""
    jacobian = np.zeros((2, 2, 4))
    jacobian[0, 0, 0], jacobian[0, 1, 1], jacobian[1, 0, 2], jacobian[1, 1, 3] = 1, 1, 1, 1
    right = np.array([0.0, 5.0, 0.0, -5.0])
    held, x, force, clean = pressing(
        np.asfortranarray(np.eye(4)), right, jacobian, np.zeros((2, 2)), (0, 1)
    )
    assert (held, clean) == ((1,), True)
    assert x.tolist() == [0.0, 5.0, 0.0, 0.0]
    assert force.tolist() == [[0.0, 0.0], [0.0, 5.0]]
