"""Many ticks of each world in one call: compiled code within MuJoCo's batch calls the tick."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rmrc.law.addresses import call_c, caller_of, words_at, words_of
from rmrc.law.jit import Array, address, entry
from rmrc.plants.lockstep import tick
from rmrc.plants.native import Native, function_at, offsets

# The head of the words, which all worlds share: the functions to call, the end of the block, and the place of
# each world's words. Pairs follow it: the index of the word of a world that holds the address of a field of
# its MjData, and the place of that address in MjData.
(
    TICK, BEFORE, AFTER, STEP, STEPS, LAST, ROWS, WORLDS, STRIDE, PAIRS, WARNING_WORD, WARNING, KEPT,
    COUNT, KEPT_ROWS, HEAD,
) = range(16)  # fmt: skip
# The dimensions of the arrays that `tick` takes; numba passes each as words, from a world's second word on.
DIMENSIONS = (1, 2, 3, 2, 3, 3, 3, 3, 3, 2, 2)
ARGUMENTS = sum(5 + 2 * dimensions for dimensions in DIMENSIONS)
_call_tick = caller_of(ARGUMENTS)


@entry
def block(model: int, data: int, world: int, about: int) -> None:
    """Do ticks of one world, from the one in its first word, until it ends or has reached LAST.

    Its first word counts them: after an error it holds the last tick.

    Args:
        model: Address of its MjModel, as mjb_apply gives it.
        data: Address of its MjData.
        world: Its number.
        about: Address of the head.
    """
    head = words_at(about, HEAD)
    pairs, own = words_at(about + 8 * HEAD, 2 * head[PAIRS]), head[ROWS] + 8 * head[STRIDE] * world
    words = words_at(own, head[STRIDE])
    for i in range(head[PAIRS]):
        words[pairs[2 * i]] = words_at(data + pairs[2 * i + 1], 1)[0]
    words[head[WARNING_WORD]] = data + head[WARNING]
    qpos = words_at(words[pairs[0]], head[COUNT])
    while words[0] < head[LAST]:
        call_c(head[BEFORE], model, data)
        t = words[0]
        if head[KEPT] != 0:
            row = (t % head[KEPT_ROWS]) * head[WORLDS] + world
            kept = words_at(head[KEPT] + 8 * row * head[COUNT], head[COUNT])
            for i in range(head[COUNT]):
                kept[i] = qpos[i]
        running = _call_tick(head[TICK], own + 8, t)
        words[0] = t + 1
        if running == 0:
            break
        if head[AFTER] != 0:
            call_c(head[AFTER], model, data)
            for _ in range(1, head[STEPS]):
                call_c(head[STEP], model, data)


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
            arrays: Worlds, (w,), ticks, (rows, w), and references, (r, ticks, 13), as `tick` has them.
            is_compensated: Whether `tick` reads the gravity compensation.
            kept: Target of all positions, (rows, w, nq); None: they are not kept.
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
        given = (worlds, ticks, reference, batch.state[:1], batch.warning[:1], *seen)
        self._batch, self._holds, self._substeps = batch, (*given, kept), substeps
        words = [words_of(one) for one in (worlds[:1], *given[1:])]
        begins = np.cumsum([1, *map(len, words)])[:-1]
        self._words = np.zeros((len(worlds), 1 + ARGUMENTS), np.int64)
        self._words[:, 1:] = np.concatenate(words)
        of_worlds, of_ticks, _, state, warning, *places = (begins + 4).tolist()
        each = np.arange(len(worlds))
        # a world's own row of the shared arrays, as if it were alone
        self._words[:, of_worlds] += each * worlds.itemsize
        self._words[:, of_ticks] += each * ticks.itemsize
        named = [("qpos", state), *((name, at) for name, at in zip(fields, places, strict=True) if name)]
        pairs = [number for name, at in named for number in (at, offsets()[name])]
        self._head = np.zeros(HEAD + len(pairs), np.int64)
        self._head[HEAD:] = pairs
        self._fill(
            {
                TICK: address(tick, *given, 0),
                BEFORE: function_at("mj_step1" if substeps else "mj_fwdKinematics"),
                STEP: function_at("mj_step"), STEPS: substeps,
                ROWS: self._words.ctypes.data, WORLDS: len(worlds), STRIDE: self._words.shape[1],
                PAIRS: len(named), WARNING_WORD: warning, WARNING: offsets()["warning"],
            }
        )  # fmt: skip
        if kept is not None:
            self._fill({KEPT: kept.ctypes.data, COUNT: kept.shape[2], KEPT_ROWS: len(kept)})
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
        self._words[ids, 0] = first
        self._head[LAST] = last
        self._head[AFTER] = function_at("mj_step2") if steps and self._substeps else 0
        self._batch.apply(ids, self._block, self._head.ctypes.data)

    def finished(self, ids: NDArray[np.intp]) -> NDArray[np.int64]:
        """Return the number of finished ticks of some worlds, including those before the last block."""
        finished: NDArray[np.int64] = self._words[ids, 0]
        return finished


def _seen(batch: Native, name: str) -> NDArray[Any]:
    """Return an array like that of MuJoCo's own batch, (1, …), of no world; without a name, an empty one."""
    seen = getattr(batch.data, name)[None].view() if name else np.empty((1, 0))
    seen.flags.writeable = False
    return seen
