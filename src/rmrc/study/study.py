"""Variants of one scenario, prepared as fast as they come: each is to the bit what it is alone."""

from collections.abc import Sequence
from contextlib import suppress

from rmrc.results.scorecard import refuse_unknown
from rmrc.scenario import Change, Draft, Variant
from rmrc.simulation.prepare import Known, Prepared, prepare
from rmrc.support.errors import ScenarioError
from rmrc.support.problems import Problem


class Study:
    """A scenario of which any number of variants are prepared; one thread at a time."""

    def __init__(self, base: Draft) -> None:
        """Keep what all variants share.

        Args:
            base: It may be wrong as long as the variants are not.
        """
        self._draft, self._known = base, Known()
        self._scenario = None
        with suppress(ScenarioError):  # told of each variant
            self._scenario = base.scenario()

    def prepare(self, changes: Sequence[Change] = ()) -> Prepared:
        """Return a variant, with everything checked.

        Args:
            changes: That make it.

        Raises:
            ScenarioError: All that is wrong with it.
        """
        if self._scenario is None:
            scenario = self._draft.changed(*changes).scenario()
        else:
            scenario = self._scenario.changed(*changes) if changes else self._scenario
        prepared = prepare(scenario, self._known)
        refuse_unknown(prepared.scenario, prepared.arm.joints)
        return prepared

    def prepare_all(self, variants: Sequence[Variant]) -> list[Prepared]:
        """Return variants, checked and ready to run.

        Raises:
            ScenarioError: All that is wrong with all variants, each problem with the variant that has it;
                what is wrong with every one of them is told once.
        """
        prepared: list[Prepared] = []
        problems: dict[Problem, list[str]] = {}  # who has it, by what it is
        for variant in variants:
            try:
                prepared.append(self.prepare(variant.changes))
            except ScenarioError as error:
                for problem in error.problems:
                    problems.setdefault(problem, []).append(variant.label)
        told: list[Problem] = []
        for problem, labels in problems.items():
            everyone = len(labels) == len(variants)
            who = [""] if everyone else [f'variant "{label}"' for label in labels]
            told += [problem._replace(who=one) for one in who]
        if told:
            raise ScenarioError(told)
        return prepared
