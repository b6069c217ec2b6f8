"""Event-driven simulation of hard spheres: one event list for particles and walls.

simulation        HardSpheres, the public class
event_loop        take the earliest event, respond, predict again
next_event        a sphere's next collision, or the exit from its cell
event_tree        the event list
neighbours        cells and neighbour lists
starting_points   positions and velocities at the start
state             the arrays
"""
