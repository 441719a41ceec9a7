"""The control law, compiled: `law.py` reads like the equations, the other modules are its terms."""
