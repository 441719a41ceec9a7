"""Meshes of a model that MuJoCo cannot read are left out if the arm moves alike without them."""

import mujoco

from rmrc.support.legible import listed


def drop_unreadable(spec: mujoco.MjSpec, contacts: bool) -> list[str]:
    """Remove meshes whose file is missing or cannot be decoded, with their geoms.

    Args:
        spec: Specification of the model, parsed and not compiled.
        contacts: Whether geoms with contacts are removed as well; otherwise only visual geoms without
            mass.

    Returns:
        Notes about the removed meshes.
    """
    seen, touched = [], []
    for mesh in list(spec.meshes):
        if not mesh.file or _is_readable(spec, mesh):
            continue
        shapes = [geom for geom in spec.geoms if geom.meshname == mesh.name]
        touching = [geom for geom in shapes if geom.contype or geom.conaffinity]
        if not contacts and (touching or not all(map(_weighs_nothing, shapes))):
            continue
        seen += [geom.parent.name for geom in shapes if geom not in touching]
        touched += [geom.parent.name for geom in touching]
        for geom in shapes:
            spec.delete(geom)
        spec.delete(mesh)
    why = "a missing mesh, or one in a format that MuJoCo cannot read"
    notes = [f"body {listed(dict.fromkeys(seen))} is drawn without {why}"] if seen else []
    if touched:
        notes.append(f"body {listed(dict.fromkeys(touched))} collides without {why}")
    return notes


def _weighs_nothing(geom: mujoco.MjsGeom) -> bool:
    return bool(geom.mass == 0.0 or geom.density == 0.0 or geom.parent.explicitinertial)


def _is_readable(spec: mujoco.MjSpec, mesh: mujoco.MjsMesh) -> bool:
    """Return whether MuJoCo can compile a mesh by itself."""
    alone = mujoco.MjSpec()
    alone.modelfiledir, alone.meshdir = spec.modelfiledir, mesh.compiler.meshdir
    alone.add_mesh(name="mesh", file=mesh.file, scale=mesh.scale, content_type=mesh.content_type)
    alone.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_MESH, meshname="mesh", contype=0, conaffinity=0, density=0.0
    )
    try:
        alone.compile()
    except ValueError:
        return False
    return True
