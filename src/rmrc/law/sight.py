"""The input of a step outside a run, and where that step reads kinematics."""

import math
from typing import TYPE_CHECKING, Any, ClassVar, TypeAlias

import numpy as np

from rmrc.law.jit import Array
from rmrc.law.record import CHAIN, JOINTS, Field
from rmrc.law.step import CHAIN_ALONE, JACOBIAN_ALONE

if TYPE_CHECKING:
    from rmrc.arm import Arm
    from rmrc.law.task import SecondTask

MjModel: TypeAlias = Any  # MuJoCo's type; a law that only gets a Jacobian does not load MuJoCo


class Sight:
    """The input of a step and the source of its kinematics: it owns the fields of a record that hold them.

    Attributes:
        sites: Number of sites that are read from MuJoCo's data; 0: the chain is followed; −1: J is given.
        is_beside: Whether positions of bodies are read instead of sites, which the model lacks.
        joint: Ids of the chain's joints in the model of the data.
    """

    fields: ClassVar[tuple[Field, ...]] = (
        Field("sites", np.int64), Field("joint", np.int64, (CHAIN,)),
        Field("site", np.int64, (2,)), Field("body", np.int64, (2,)), Field("site_quat", size=(2, 4)),
        # place of the site in the body whose position is read instead, as the model lacks the site
        Field("is_beside", np.int64), Field("site_step", size=(2, 3)),
        # the input, its time, and the refused parts of it; periods without a step
        Field("given", np.int64), Field("called"), Field("refused", np.int64), Field("late", np.int64),
        Field("base", size=(7,)), Field("given_matrix", size=(4, 4)), Field("given_vector", size=(6,)),
        Field("q_target", size=(JOINTS,)), Field("qdot_target", size=(JOINTS,)),
        # memory outside a run: integral of the commands, joints on their way back, the change before
        Field("q_cmd", size=(JOINTS,), start=math.nan), Field("returning", size=(JOINTS,)),
        Field("change_before", size=(JOINTS,)),
    )  # fmt: skip

    def __init__(
        self,
        arm: "Arm | None" = None,
        second: "SecondTask | None" = None,
        model: "MjModel | None" = None,
    ) -> None:
        """Choose the source of the kinematics.

        Args:
            arm: The arm; None if only a Jacobian is given.
            second: A second task, if any.
            model: Model of the data that are read; None: the arm's own chain.

        Raises:
            KeyError: The model lacks a joint of the arm, or the body with the site.
        """
        self.sites = JACOBIAN_ALONE if arm is None else CHAIN_ALONE
        self._base = None if arm is None else arm.base_pose
        self._places: list[tuple[int, int, Array, Array]] = []
        self.joint, self.is_beside = np.zeros(0, np.int64), False
        if model is not None and arm is not None:
            self.joint = np.array([model.joint(name).id for name in arm.axis_names], np.int64)
            names = [arm.site, second.site] if second else [arm.site]
            own = {model.site(i).name for i in range(model.nsite)}
            self.is_beside, self.sites = not own.issuperset(names), len(names)
            for name in names:
                seen = arm.model if self.is_beside else model
                site = seen.site(name)
                carrier = seen.body(int(seen.site_bodyid[site.id])).name if self.is_beside else ""
                body = model.body(carrier).id if self.is_beside else int(seen.site_bodyid[site.id])
                self._places.append((body if self.is_beside else site.id, body, site.quat, site.pos))

    @property
    def bodies(self) -> list[int]:
        """Ids of the bodies with the sites."""
        return [body for _, body, _, _ in self._places]

    def write(self, world: np.void) -> None:
        """Write its fields of a world's record."""
        world["sites"], world["is_beside"] = self.sites, self.is_beside
        world["joint"][: len(self.joint)] = self.joint
        for i, (place, body, quat, step) in enumerate(self._places):
            world["site"][i], world["body"][i] = place, body
            world["site_quat"][i], world["site_step"][i] = quat, step
        if self._base is not None:
            world["base"] = self._base
