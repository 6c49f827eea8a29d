"""One stride of the template: its phases' motion and where their guards fire.

Arguments of these names are the same in all compiled functions of this folder:

* ``state`` (4 or more,) x, y, dx/dt, dy/dt of the CoM [m, m/s], in the world frame with y up
* ``toes`` (2,) x of the rear and the front toe [m]; ``stiffness`` (2,) of their legs [N/m], 0 for a
  leg in the air
* ``rest_length`` l0 [m], ``touchdown_height`` l0 sin(alpha) [m], ``alpha`` the touchdown angle
  from the ground to the leg [rad]
* ``controls`` (NUM_SLOTS,) u by Slot: touchdown angle [rad] and stiffnesses [N/m]
* ``event``, ``reset`` values of the Event and of the Reset
* ``model`` the template's physics, ``kernel`` with the automaton and the first node
* ``scratch`` arrays of one thread, overwritten
"""
