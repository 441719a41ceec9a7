"""Random serial chains as MJCF, for tests over arms that nobody drew: hinges and slides, any axes, any size."""

import numpy as np
from hypothesis import strategies as st

seeds = st.integers(0, 2**32 - 1)


def random_followers(seed, n):
    """Return (follower, leader, a, b) of joint equalities of a chain of n joints: follower = a + b leader from qpos0.

    In no circle, inward and outward, through each other and through the joint `side`, which is not on the chain.
    At least one joint of the chain follows none.
    """
    rng = np.random.default_rng([seed, 3])
    names = [f"j{j}" for j in rng.permutation(n)]
    names.insert(int(rng.integers(1, n + 1)), "side")
    return [
        (name, names[rng.integers(0, i)], rng.normal() * 0.2, rng.normal())
        for i, name in enumerate(names)
        if i > 0 and rng.random() < 0.6
    ]


def random_chain(seed, n=None, ranges=False, followers=False):
    """Return the MJCF of a chain of 1 to 8 joints, with a free body and a side branch that are not its own.

    With `ranges`, every other joint or so has position limits around 0, and the middle body a site `middle`.
    With `followers`, joints follow others: see `random_followers`.
    """
    rng, more = np.random.default_rng(seed), np.random.default_rng([seed, 1])
    n = int(rng.integers(1, 9)) if n is None else n
    text = lambda values: " ".join(f"{value:.17g}" for value in values)  # noqa: E731
    bodies, closing = "", ""
    for j in range(n):
        kind = "slide" if rng.random() < 0.3 else "hinge"
        quat = rng.normal(size=4)
        reach = more.uniform(0.3, 1.2, 2) * (
            180 / np.pi if kind == "hinge" else 1.0
        )  # degrees, as MJCF has it
        limits = f'range="{text([-reach[0], reach[1]])}" ' if ranges and more.random() < 0.5 else ""
        bodies += (
            f'<body name="b{j}" pos="{text(rng.uniform(-0.4, 0.4, 3))}" quat="{text(quat)}">'
            f'<joint name="j{j}" type="{kind}" axis="{text(rng.normal(size=3))}" pos="{text(rng.uniform(-0.1, 0.1, 3))}" '
            f'{limits}{f"""ref="{more.normal():.17g}" """ if followers else ""}armature="0.1"/><geom type="capsule" fromto="0 0 0 {text(rng.uniform(-0.3, 0.3, 3))}" size="0.03"/>'
        )
        closing += "</body>"
        if ranges and j == n // 2:
            bodies += '<site name="middle" pos="0.1 0.2 -0.1"/>'
        if j == 0:  # a branch, so that dof numbers are not joint numbers of the arm
            bodies += '<body name="side"><joint name="side" axis="1 0 0"/><geom size="0.05"/></body>'
    site = f'<site name="tip" pos="{text(rng.uniform(-0.3, 0.3, 3))}" quat="{text(rng.normal(size=4))}"/>'
    equalities = "".join(
        f'<joint joint1="{follower}" joint2="{leader}" polycoef="{a:.17g} {b:.17g} 0 0 0"/>'
        for follower, leader, a, b in (random_followers(seed, n) if followers else ())
    )
    return (
        '<mujoco><option gravity="0 0 -9.81"/><default><geom contype="0" conaffinity="0"/></default><worldbody>'
        '<body name="ball" pos="3 0 0"><freejoint/><geom size="0.1"/></body>'
        f"{bodies}{site}{closing}</worldbody>"
        f"<equality>{equalities}</equality></mujoco>"
    )
