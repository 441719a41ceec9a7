"""Many ticks of each world in one call: compiled code within MuJoCo's batch calls the tick."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rmrc.law.addresses import caller_of, words_at, words_of
from rmrc.law.jit import Array, address, entry
from rmrc.plants import around
from rmrc.plants.lockstep import tick
from rmrc.plants.native import Native, function_at, offsets

# The dimensions of the arrays that `tick` takes; numba passes each as words. The last word is `about`.
DIMENSIONS = (1, 2, 3, 2, 3, 3, 3, 3, 3, 2, 2)
ARGUMENTS = 1 + sum(5 + 2 * dimensions for dimensions in DIMENSIONS)
_call_tick = caller_of(ARGUMENTS)


@entry
def block(model: int, data: int, world: int, about: int) -> None:
    """Do ticks of one world, from the one in its word DONE, until it ends or has reached LAST.

    That word counts them: after an error it holds the last tick.

    Args:
        model: Address of its MjModel, as mjb_apply gives it.
        data: Address of its MjData.
        world: Its number.
        about: Address of the head.
    """
    head = words_at(about, around.HEAD)
    pairs = words_at(about + 8 * around.HEAD, 2 * head[around.PAIRS])
    own = head[around.ROWS] + 8 * head[around.STRIDE] * world
    words = words_at(own, head[around.STRIDE])
    for i in range(head[around.PAIRS]):
        words[pairs[2 * i]] = words_at(data + pairs[2 * i + 1], 1)[0]
    words[head[around.WARNING_WORD]] = data + head[around.WARNING]
    words[around.TO_MODEL], words[around.TO_DATA], words[around.TO_QPOS] = model, data, words[pairs[0]]
    if words[around.DONE] < head[around.LAST]:
        _call_tick(head[around.TICK], own + 8 * around.OWN, words[around.DONE])


class Blocks:
    """Blocks of ticks of worlds that are stepped together."""

    def __init__(
        self,
        batch: Native,
        forces: str,
        substeps: int,
        arrays: tuple[NDArray[np.void], NDArray[np.void], Array],
        is_compensated: bool,
        kept: Array | None,
    ) -> None:
        """Prepare the words.

        Args:
            batch: MuJoCo's part.
            forces: Name of the field with the forces of the last step.
            substeps: MuJoCo's steps in a tick; 0 where it only computes kinematics.
            arrays: Worlds, (w,), ticks, (w, rows), and references, (r, ticks, 13), as `tick` has them.
            is_compensated: Whether `tick` reads the gravity compensation.
            kept: Target of all positions, (w, rows, nq); None: they are not kept.
        """
        worlds, ticks, reference = arrays
        fields = (
            "site_xpos",
            "site_xquat",
            "xanchor",
            "xaxis",
            forces,
            "qfrc_gravcomp"[: 13 * is_compensated],
        )
        seen = [_seen(batch, name) for name in fields]
        given = (worlds[:1], ticks[:1], reference, batch.state[:1], batch.warning[:1], *seen)
        self._batch, self._holds, self._substeps = batch, (*arrays, *seen, kept), substeps
        words = [words_of(one) for one in given]
        begins = np.cumsum([around.OWN, *map(len, words)])[:-1]
        self._words = np.zeros((len(worlds), around.OWN + ARGUMENTS), np.int64)
        self._words[:, around.OWN : -1] = np.concatenate(words)
        of_worlds, of_ticks, _, state, warning, *places = (begins + 4).tolist()
        each = np.arange(len(worlds))
        # a world's own row of the shared arrays, as if it were alone
        self._words[:, of_worlds] += each * worlds.itemsize
        self._words[:, of_ticks] += each * ticks.strides[0]
        named = [("qpos", state), *((name, at) for name, at in zip(fields, places, strict=True) if name)]
        pairs = [number for name, at in named for number in (at, offsets()[name])]
        self._head = np.zeros(around.HEAD + len(pairs), np.int64)
        self._head[around.HEAD :] = pairs
        self._fill(
            {
                around.TICK: address(tick, worlds, *given[1:], 0, 0, at_need=True),  # all: it links them
                around.BEFORE: function_at("mj_step1" if substeps else "mj_fwdKinematics"),
                around.STEP: function_at("mj_step"), around.STEPS: substeps,
                around.ROWS: self._words.ctypes.data, around.STRIDE: self._words.shape[1],
                around.PAIRS: len(named), around.WARNING_WORD: warning, around.WARNING: offsets()["warning"],
            }
        )  # fmt: skip
        if kept is not None:
            self._fill(
                {around.KEPT: kept.ctypes.data, around.COUNT: kept.shape[2], around.KEPT_ROWS: kept.shape[1]}
            )
            self._words[:, around.TO_KEPT] = kept.ctypes.data + each * kept.strides[0]
        self._words[:, around.TO_HEAD] = self._head.ctypes.data
        self._words[:, -1] = self._words.ctypes.data + each * self._words.strides[0]
        self._block = address(block, 0, 0, np.int32(0), 0, is_c=True)

    def _fill(self, numbers: dict[int, int]) -> None:
        for at, number in numbers.items():
            self._head[at] = number

    def run(self, ids: NDArray[np.intp], first: int, last: int, steps: bool) -> None:
        """Do ticks [first, last) of some worlds; worlds that end stop earlier.

        Args:
            ids: Numbers of the worlds.
            first: Number of the first tick.
            last: One after the last tick.
            steps: Whether MuJoCo steps after each tick.

        Raises:
            SimulationError: MuJoCo raised an error in some of them.
        """
        self._words[ids, around.DONE] = first
        self._head[around.LAST] = last
        self._head[around.AFTER] = function_at("mj_step2") if steps and self._substeps else 0
        self._batch.apply(ids, self._block, self._head.ctypes.data)

    def finished(self, ids: NDArray[np.intp]) -> NDArray[np.int64]:
        """Return the number of finished ticks of some worlds, including those before the last block."""
        finished: NDArray[np.int64] = self._words[ids, around.DONE]
        return finished


def _seen(batch: Native, name: str) -> NDArray[Any]:
    """Return an array like that of MuJoCo's own batch, (1, …), of no world; without a name, an empty one."""
    seen = getattr(batch.data, name)[None].view() if name else np.empty((1, 0))
    seen.flags.writeable = False
    return seen
