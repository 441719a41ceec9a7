"""Questions about any arm that need no run: what it is at a configuration, where it reaches, what it bears.

The kinematics are MuJoCo's, or those of the compiled law where a million configurations are asked; the
formulas are those of `rmrc.textbook`.
"""
