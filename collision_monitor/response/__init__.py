"""Collision response: velocities, positions and forces of bodies that meet; for simulations, never for the monitor.

    planes         reflect, clamp, last_free                     a body and a wall, plane or ground
    two_bodies     collide, stick, average, swap                 two movable bodies without rotation
    penalty        penalty_force, spring_stiffness, damping_for  a spring and a damper that push bodies apart
    mass           mass_properties, MassProperties               mass, centre and inertia of a shape
    rotation       collide_rotating, RigidBody                   impulse at the contact point, with friction
    simultaneous   collide_together, bodies_collide_together     all contacts of one instant, symmetric
    resting        hold_contacts, ContactImpulses                contacts under load, with friction
    contact_set    Bodies, Contacts                              the arrays that the last two take
    bonded         move_as_one                                   bodies that stay together and turn as one

Vectors are (..., 3) or (..., 2) in m, m/s and rad/s, masses in kg; normals need not be of unit length; leading
dimensions broadcast. A mass may be infinite (an immovable body). Every function raises InputError for a restitution
outside 0 to 1, a mass that is not positive, a negative friction, a zero normal and values that are not finite.
docs/response.md compares the methods.

>>> reflect((1, 0, -2), normal=(0, 0, 1), restitution=0.5)
array([1., 0., 1.])
"""

from collision_monitor.response.bonded import move_as_one
from collision_monitor.response.contact_set import Bodies, Contacts
from collision_monitor.response.mass import MassProperties, mass_properties
from collision_monitor.response.penalty import damping_for, penalty_force, spring_stiffness
from collision_monitor.response.planes import clamp, last_free, reflect
from collision_monitor.response.resting import ContactImpulses, hold_contacts
from collision_monitor.response.rotation import RigidBody, collide_rotating
from collision_monitor.response.simultaneous import bodies_collide_together, collide_together
from collision_monitor.response.two_bodies import average, collide, stick, swap

__all__ = [
    "Bodies",
    "ContactImpulses",
    "Contacts",
    "MassProperties",
    "RigidBody",
    "average",
    "bodies_collide_together",
    "clamp",
    "collide",
    "collide_rotating",
    "collide_together",
    "damping_for",
    "hold_contacts",
    "last_free",
    "mass_properties",
    "move_as_one",
    "penalty_force",
    "reflect",
    "spring_stiffness",
    "stick",
    "swap",
]
