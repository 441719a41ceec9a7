"""The part of MuJoCo in each tick of a block, called at its addresses by compiled code."""

from rmrc.law.addresses import call_c, words_at
from rmrc.law.jit import compiled

# The head of the words, which all worlds of a block share: the function that does ticks, those of MuJoCo, the
# end of the block, and the place of each world's words. Pairs follow the head: the index of the word of a
# world that holds the address of a field of its MjData, and the place of that address in MjData.
(
    TICK, BEFORE, AFTER, STEP, STEPS, LAST, ROWS, STRIDE, PAIRS, WARNING_WORD, WARNING, KEPT, COUNT,
    KEPT_ROWS, HEAD,
) = range(15)  # fmt: skip
# The words of a world; the arguments of `tick` follow: the number of finished ticks, addresses of the head,
# of its MjModel, MjData and qpos, and of the rows that keep qpos.
DONE, TO_HEAD, TO_MODEL, TO_DATA, TO_QPOS, TO_KEPT, OWN = range(7)


@compiled
def begin_tick(about: int, t: int) -> None:
    """Have MuJoCo compute what a tick reads, and keep qpos; `about` is the address of a world's words."""
    own = words_at(about, OWN)
    head = words_at(own[TO_HEAD], HEAD)
    call_c(head[BEFORE], own[TO_MODEL], own[TO_DATA])
    if head[KEPT] != 0:
        qpos, count = words_at(own[TO_QPOS], head[COUNT]), head[COUNT]
        kept = words_at(own[TO_KEPT] + 8 * count * (t % head[KEPT_ROWS]), count)
        for i in range(count):
            kept[i] = qpos[i]


@compiled
def end_tick(about: int, t: int, going: bool) -> bool:
    """Count a tick, and step a world that has a next one; return whether that belongs to this block."""
    own = words_at(about, OWN)
    head = words_at(own[TO_HEAD], HEAD)
    own[DONE] = t + 1
    if going and head[AFTER] != 0:
        call_c(head[AFTER], own[TO_MODEL], own[TO_DATA])
        for _ in range(1, head[STEPS]):
            call_c(head[STEP], own[TO_MODEL], own[TO_DATA])
    return going and t + 1 < head[LAST]
