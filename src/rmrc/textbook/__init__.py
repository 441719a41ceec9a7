"""The kinematics and statics of the source notes: one function an equation, numpy only.

This is the independent second opinion: nothing here knows MuJoCo, so what it says can be held
against what the simulation does. Arrays in, arrays out, over any leading axes; rad and m.
"""
