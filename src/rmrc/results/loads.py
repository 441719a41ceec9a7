"""Loads on an arm that may be unintended, one line each: contact, actuators at their limits, slips."""

from collections.abc import Collection, Iterator

from rmrc.results.scorecard import Scorecard

SLIP_CURE = "write no solref and solimp there, or stiffer ones"


def told(card: Scorecard, expected: Collection[str]) -> Iterator[str]:
    """Yield duration and start of contacts and of actuators at their limit, and duration and size of slips.

    Args:
        card: Scorecard of the run.
        expected: Names of metrics that the scenario expects; the loads that they measure are left out.
    """
    if not _is_about(expected, "contact."):
        yield from _line(
            card, "CONTACT", f"first {card['contact.first_bodies'].value}",
            "move the path or arm.start, exclude the pair in the model if its shapes are inexact",
        )  # fmt: skip
    if not _is_about(expected, "torque_limited.", "tau.share_of_limit"):
        yield from _line(
            card, "TORQUE_LIMITED", f'first joint "{card["torque_limited.first_joint"].value}"',
            "lower target.limits or control.limits",
        )  # fmt: skip
    seconds = card["status_time.SLIPPED"].value
    if seconds and not _is_about(expected, "slip.", "status_time.SLIPPED"):
        slip, time = card["slip.max"].value, card["slip.max_time"].value
        yield (
            f"{card.name}: SLIPPED for {seconds:.3g} s, a follower {slip:.3g} rad or m off its equality at "
            f"{time:.4g} s; {SLIP_CURE}"
        )


def _line(card: Scorecard, status: str, which: str, cure: str) -> Iterator[str]:
    group = status.lower()
    seconds, first = card[f"{group}.time"].value, card[f"{group}.first_time"].value
    if seconds:
        yield (
            f"{card.name}: {status} for {seconds:.3g} s from {first:.4g} s on, {which}; {cure}, or state "
            f"an expectation: expect: {{{group}.time: {{below: ...}}}}"
        )


def _is_about(expected: Collection[str], *groups: str) -> bool:
    return any(name.startswith(groups) for name in expected)
