"""A chain with a screw joint as MJCF: a hinge, and a slide along its axis that an equality makes follow it."""


def screw_chain(ratio=0.05, slide_axis="0 0 1", order="hinge first", equality=None):
    """Return a screw of `ratio` m/rad between two hinges; `order` says which half of it comes first."""
    hinge = '<joint name="screw" axis="0 0 1" pos="0.1 0 0" range="-120 120" ref="20"/>'
    slide = f'<joint name="travel" type="slide" axis="{slide_axis}" range="-0.08 0.2" ref="0.01"/>'
    halves = (hinge, slide) if order == "hinge first" else (slide, hinge)
    if equality is None:
        equality = (
            f'<joint joint1="travel" joint2="screw" polycoef="0.02 {ratio} 0 0 0" '
            'solref="0.004 1" solimp="0.999 0.9999 0.001"/>'
        )
    return f"""<mujoco><compiler angle="degree"/><option timestep="0.001" integrator="implicitfast"/>
<default><geom contype="0" conaffinity="0"/></default><worldbody>
<body quat="0.9 0.3 0.2 0.1"><joint name="turn" axis="0 1 0"/><geom size="0.05"/>
<body pos="0.2 0 0.1">{halves[0]}<geom size="0.02" pos="0 0 0.1"/>
<body>{halves[1]}<geom type="capsule" fromto="0 0 0 0.3 0 0.1" size="0.02"/>
<body pos="0.3 0 0.1"><joint name="swing" axis="0.6 0 0.8"/><geom size="0.04"/><site name="tip" pos="0 0.2 0.1"/>
</body></body></body></body></worldbody><equality>{equality}</equality></mujoco>"""
