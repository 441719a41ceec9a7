"""The joint torques that balance a wrench, by the Jacobian and by the physics."""
