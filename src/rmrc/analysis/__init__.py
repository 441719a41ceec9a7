"""Analyses of an arm without a run: kinematics at a configuration, inverse kinematics, workspace, statics.

The kinematics are MuJoCo's, or those of the compiled law for a million configurations; the
formulas are those of `rmrc.textbook`.
"""
