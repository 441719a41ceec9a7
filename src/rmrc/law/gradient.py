"""Derivatives of the singular values by the joints, from the derivative of J, without differences."""

from rmrc.law.compiling import Array, Record, compiled
from rmrc.law.inertia import add_energy_gradient
from rmrc.law.kinematics import SITE
from rmrc.law.metric import INERTIA, backward, scale_joints
from rmrc.law.svd import clear, copy


@compiled
def sigma_gradient(world: Record, i: int, gradient: Array) -> None:
    """Write ∂σ_i/∂q_j = u_iᵀ (∂A/∂q_j) v_i, (n,), by the geometric derivative of J.

    A joint turns the columns of all joints behind it, and moves the site for the columns of joints before it:

        ∂[v_l; ω_l]/∂q_j = [ω_j × v_l; ω_j × ω_l]  for j before l,  [ω_l × v_j; 0] else

    The columns of sliding joints have ω = 0, so the same terms serve them. Every joint turns the axes of the
    site: along these, −[ω_j × v_l; ω_j × ω_l] is added to all columns, so the first case becomes 0. Where
    joints follow others, j and l are axes of the chain, each of which moves by a ratio of its leader.

    Args:
        world: Read: J, the frame of its rows, the decomposition and the scales.
        i: Index of the singular value.
        gradient: Written, (n,) [1/rad or 1/m].
    """
    copy(world.first.v[i], world.scratch.shape, world.n)
    scale_joints(world, world.scratch.shape)
    is_alone = world.chain.axes == world.n
    gradient_of(world, i, world.state.J if is_alone else world.chain.columns, gradient)
    if world.law.inverse_metric == INERTIA:
        add_metric_gradient(world, i, gradient)


@compiled
def add_metric_gradient(world: Record, i: int, gradient: Array) -> None:
    """Add the change of σ_i that the change of the joint inertia causes: −σ_i ∂T/∂q at the rates of v_i."""
    shape, first = world.scratch.shape, world.first
    copy(first.v[i], shape, world.n)
    backward(world.links.root, shape, world.n)
    for j in range(world.n):
        shape[j] *= world.links.scale[j]
    add_energy_gradient(world, shape, -first.sigma[i], gradient)


@compiled
def gradient_of(world: Record, i: int, J: Array, gradient: Array) -> None:
    """Write the gradient for `sigma_gradient` from the contributions of the axes, (6, ℓ)."""
    n, turns = world.chain.axes, world.task.frame == SITE
    task, wrench = world.task, world.scratch.wrench
    clear(wrench, 6)
    for r in range(world.m):
        wrench[task.row[r]] = task.row_scale[r] * world.first.u[i, r]
    fx, fy, fz, mx, my, mz = wrench[0], wrench[1], wrench[2], wrench[3], wrench[4], wrench[5]
    for a in range(n):
        leader = world.chain.leader[a]
        world.chain.rate[a] = world.chain.ratio[a] * world.scratch.shape[leader]
    clear(gradient, world.n)
    for j in range(n):
        ax = ay = az = bx = by = bz = 0.0
        for l in range(n):  # noqa: E741  the index of the slopes (15) of docs/theory.md
            x = world.chain.rate[l]
            ox, oy, oz = x * J[3, l], x * J[4, l], x * J[5, l]
            if l <= j:  # the axes of a chain are in this order
                bx, by, bz = bx + ox, by + oy, bz + oz
            if (l > j) != turns:
                vx, vy, vz = x * J[0, l], x * J[1, l], x * J[2, l]
                ax += vy * fz - vz * fy + oy * mz - oz * my
                ay += vz * fx - vx * fz + oz * mx - ox * mz
                az += vx * fy - vy * fx + ox * my - oy * mx
        if turns:
            ax, ay, az = -ax, -ay, -az
        gradient[world.chain.leader[j]] += world.chain.ratio[j] * (
            J[3, j] * ax + J[4, j] * ay + J[5, j] * az
            + J[0, j] * (fy * bz - fz * by) + J[1, j] * (fz * bx - fx * bz) + J[2, j] * (fx * by - fy * bx)
        )  # fmt: skip
