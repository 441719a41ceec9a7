"""Which joint torques balance a wrench, by the Jacobian and by the physics."""
