"""Many contacts at one instant: symmetry, Newton's cradle, conservation laws, bodies that rest and that stick."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import collision_monitor as cm
from collision_monitor.response import Bodies, Contacts, collide, collide_together, hold_contacts, move_as_one, stick
from collision_monitor.response.simultaneous import bodies_collide_together

seeds = st.integers(0, 2**32 - 1)


def row(velocities, restitution, masses=1.0):
    """Final velocities of balls in a row that touch their neighbours."""
    v = np.array(velocities, dtype=float)[:, None] * [1.0, 0.0]
    pairs = [(i, i + 1) for i in range(len(v) - 1)]
    return collide_together(v, np.broadcast_to(masses, len(v)), pairs, [(1.0, 0.0)] * len(pairs), restitution)[:, 0]


def test_two_balls_onto_a_middle_one_stay_symmetric():
    assert row([1, 0, -1], 0.5) == pytest.approx([-0.5, 0.0, 0.5], abs=1e-12)


@pytest.mark.parametrize("pulled", [1, 2, 3])
def test_newtons_cradle_sends_off_as_many_balls_as_came(pulled):
    found = row([1.0] * pulled + [0.0] * (5 - pulled), 1.0)
    assert found == pytest.approx([0.0] * (5 - pulled) + [1.0] * pulled, abs=1e-12)


def test_without_restitution_a_row_moves_on_together():
    assert row([1, 0, 0, 0], 0.0) == pytest.approx([0.25] * 4, abs=1e-11)


def test_one_contact_is_the_collision_of_two():
    rng = np.random.default_rng(1)
    for restitution in (0.0, 0.3, 1.0):
        v, normal, (ma, mb) = rng.normal(size=(2, 3)), rng.normal(size=3), rng.uniform(0.1, 9, 2)
        found = collide_together(v, [ma, mb], [[0, 1]], [normal], restitution)
        assert found == pytest.approx(np.array(collide(*v, normal, ma, mb, restitution)), abs=1e-9)


def random_contacts(seed):
    """Bodies that turn, the last immovable, with random contacts."""
    rng = np.random.default_rng(seed)
    n, m = rng.integers(2, 8), rng.integers(1, 12)
    spread = rng.normal(size=(n, 3, 3))
    inverse = spread @ spread.swapaxes(1, 2) + 0.1 * np.eye(3)
    inverse_mass = rng.uniform(0.1, 5, n)
    velocity, angular = rng.normal(size=(2, n, 3))
    inverse_mass[-1], inverse[-1], velocity[-1], angular[-1] = 0.0, 0.0, 0.0, 0.0
    a = rng.integers(0, n, m)
    b = (a + rng.integers(1, n, m)) % n
    contacts = Contacts.between(np.stack([a, b], 1), *rng.normal(size=(3, m, 3)))
    return Bodies(inverse_mass, inverse, velocity, angular), contacts


def energy(bodies):
    some = bodies.inverse_mass > 0.0
    turning = np.linalg.solve(bodies.inverse_inertia[some], bodies.angular[some][..., None])[..., 0]
    speed = (bodies.velocity[some] ** 2).sum(axis=1) / bodies.inverse_mass[some]
    return 0.5 * (speed.sum() + (turning * bodies.angular[some]).sum())


@given(seeds, st.sampled_from([0.0, 0.4, 1.0]))
def test_after_it_no_contact_closes_and_no_energy_is_made(seed, restitution):
    bodies, contacts = random_contacts(seed)
    after, impulse = bodies_collide_together(bodies, contacts, restitution)
    speed = np.abs(contacts.closing(bodies)).max()
    assert contacts.closing(after).max() <= 1e-6 * speed
    assert energy(after) <= energy(bodies) * (1 + 1e-9)
    assert (impulse >= 0.0).all()


@given(seeds)
def test_an_elastic_chain_keeps_its_energy(seed):
    """Contacts without a loop, so that nothing is wedged."""
    bodies, _ = random_contacts(seed)
    n = len(bodies.inverse_mass)
    rng = np.random.default_rng(seed)
    contacts = Contacts.between([(i, i + 1) for i in range(n - 1)], *rng.normal(size=(3, n - 1, 3)))
    after, _ = bodies_collide_together(bodies, contacts, 1.0)
    assert energy(after) == pytest.approx(energy(bodies), rel=1e-6)


def test_bodies_that_nothing_can_part_stop():
    """A ball between two walls that both close on it."""
    bodies = Bodies.without_rotation([1.0, np.inf, np.inf], [(0.5, 0.0), (1.0, 0.0), (-1.0, 0.0)])
    contacts = Contacts.between([(1, 0), (0, 2)], [(1.0, 0.0), (1.0, 0.0)])
    after, impulse = bodies_collide_together(bodies, contacts, 1.0, 100)
    assert np.isfinite(after.velocity).all()
    assert np.isfinite(impulse).all()


@given(seeds)
def test_the_order_of_the_contacts_does_not_matter(seed):
    bodies, contacts = random_contacts(seed)
    order = np.random.default_rng(seed).permutation(len(contacts.a))
    one, _ = bodies_collide_together(bodies, contacts, 0.5)
    other, _ = bodies_collide_together(bodies, contacts.take(order), 0.5)
    assert one.velocity == pytest.approx(other.velocity, abs=1e-6 * np.abs(bodies.velocity).max())


@given(seeds)
def test_impulses_are_the_least_ones(seed):
    """The inelastic answer is the velocity nearest to the old one, in energy, with which no contact closes (KKT)."""
    bodies, contacts = random_contacts(seed)
    after, impulse = bodies_collide_together(bodies, contacts, 0.0)
    opening = -contacts.closing(after)
    speed = np.abs(contacts.closing(bodies)).max()
    assert np.abs(opening[impulse > 1e-9 * impulse.max(initial=1e-300)]).max(initial=0.0) <= 1e-6 * speed


def held(mass, friction, push):
    """Velocity of a block on the ground after gravity and a sideways push (N s) have acted for one step."""
    v = np.array([[push / mass, 0.0, -0.0981], [0, 0, 0]])
    bodies = Bodies.without_rotation([mass, np.inf], v)
    contacts = Contacts.between([[0, 1]], [(0.0, 0.0, -1.0)])
    return hold_contacts(bodies, contacts, 0.0, friction).bodies.velocity[0]


def test_friction_holds_a_block_up_to_its_limit_and_brakes_it_beyond():
    weight = 2.0 * 0.0981
    assert held(2.0, 0.5, 0.49 * weight) == pytest.approx([0, 0, 0], abs=1e-12)
    assert held(2.0, 0.5, 0.8 * weight)[0] == pytest.approx(0.3 * weight / 2.0)
    assert held(2.0, 0.0, 0.8 * weight) == pytest.approx([0.8 * weight / 2.0, 0, 0])


def test_impulses_of_the_last_step_make_the_next_one_quick():
    n = 10
    bodies = Bodies.without_rotation([1.0] * n + [np.inf], np.tile([0, 0, -0.1], (n + 1, 1)) * ([[1.0]] * n + [[0.0]]))
    contacts = Contacts.between([(i, i - 1 if i else n) for i in range(n)], [(0, 0, -1.0)] * n)
    first = hold_contacts(bodies, contacts, iterations=5000)
    again = hold_contacts(bodies, contacts, impulse=first.impulse)
    assert first.impulse[:, 0] == pytest.approx(0.1 * np.arange(n, 0, -1), abs=1e-8)
    assert first.residual <= 1e-8
    assert again.iterations <= 5 < first.iterations


def test_bodies_that_move_as_one_keep_momentum_and_angular_momentum():
    rng = np.random.default_rng(3)
    n = 6
    mass, position = rng.uniform(0.5, 3, n), rng.normal(size=(n, 3))
    velocity, angular = rng.normal(size=(2, n, 3))
    inertia = np.stack([np.diag(d) for d in rng.uniform(0.1, 1, (n, 3))])
    before = Bodies(1 / mass, np.linalg.inv(inertia), velocity, angular)
    after = move_as_one(before, position, [(0, 3), (3, 5), (1, 2)])
    for group in ([0, 3, 5], [1, 2], [4]):
        for f in (lambda b, i: mass[i] * b.velocity[i], lambda b, i: (
            mass[i] * np.cross(position[i], b.velocity[i]) + inertia[i] @ b.angular[i]
        )):  # fmt: skip
            assert sum(f(after, i) for i in group) == pytest.approx(sum(f(before, i) for i in group), abs=1e-12)
        for i in group[1:]:  # a rigid motion
            offset = position[i] - position[group[0]]
            expected = after.velocity[group[0]] + np.cross(after.angular[group[0]], offset)
            assert after.velocity[i] == pytest.approx(expected, abs=1e-12)
    assert after.velocity[4].tolist() == velocity[4].tolist()


def test_two_points_that_move_as_one_are_stick_and_a_wall_stops_them():
    bodies = Bodies.without_rotation([1.0, 3.0, np.inf], [(1.0, 0), (0, 0), (0, 0)])
    bodies = bodies._replace(inverse_inertia=np.array([np.eye(3) * 10, np.eye(3) * 10, np.zeros((3, 3))]))
    line = np.array([(0.0, 0, 0), (1, 0, 0), (2, 0, 0)])
    assert move_as_one(bodies, line, [(0, 1)]).velocity[0, :2] == pytest.approx(stick((1.0, 0), (0, 0), 1.0, 3.0))
    assert not move_as_one(bodies, line, [(0, 1), (1, 2)]).velocity.any()


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (lambda: row([1, 0], 1.5), "restitution"),
        (lambda: row([1, 0], [0.5, 0.5]), "one number"),
        (lambda: row([1, 0], 0.5, [1.0, 0.0]), "mass"),
        (lambda: collide_together([(1, 0)], [1.0], [(0, 1)], [(1, 0)]), "indices from 0 to 0"),
        (lambda: collide_together([(1, 0), (0, 0)], 1.0, [(0, 0)], [(1, 0)]), "itself"),
        (lambda: collide_together([(1, 0), (0, 0)], 1.0, [(0.5, 1)], [(1, 0)]), "whole numbers"),
        (lambda: collide_together([(1, 0), (0, 0)], 1.0, [(0, 1)], [(0, 0)]), "zero vector"),
        (lambda: collide_together([(1, 0), (0, 0)], [1.0] * 3, [(0, 1)], [(1, 0)]), r"masses \(N,\)"),
    ],
)
def test_impossible_inputs_are_refused(call, text):
    with pytest.raises(cm.InputError, match=text):
        call()


def test_no_contacts_change_nothing():
    v = np.array([(1.0, 0), (0, 0)])
    assert collide_together(v, 1.0, np.zeros((0, 2), int), np.zeros((0, 2))).tolist() == v.tolist()
