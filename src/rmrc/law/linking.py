"""How compiled functions are linked: each entry is optimized once, with all that it calls."""

from collections.abc import Sequence
from typing import Any

from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler


class _Unnamed:
    """A code generator that leaves out the globals of functions that Python never calls."""

    def __init__(self, codegen: Any) -> None:
        self._codegen = codegen

    def __getattr__(self, name: str) -> Any:
        return getattr(self._codegen, name)

    def set_env(self, name: str, env: object) -> None:
        """Set nothing: code that is not loaded has no place for it."""


class Part(JITCodeLibrary):
    """The code of a function that other compiled functions call; their linker turns it into machine code.

    Numba itself would optimize it, with all that it calls, and turn it into machine code: all code once for
    each level of calls above it.
    """

    @property
    def codegen(self) -> Any:
        """A code generator, without the parts that need the code to be loaded."""
        return _Unnamed(self._codegen)

    def finalize(self) -> None:
        """Leave everything to the linker."""
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:  # noqa: ARG002 - as numba calls it
        """Return 0, as there is no machine code."""
        return 0

    def own_module(self) -> Any:
        """Return the code of this function alone, for linking."""
        return super()._get_module_for_linking()  # type: ignore[no-untyped-call]

    def _get_module_for_linking(self) -> Any:
        """Return the code with that of all its callees, for functions that numba compiles in its own way."""
        module = self.own_module().clone()
        for library in _all_parts(self._linking_libraries):
            of_part = isinstance(library, Part)
            linked = library.own_module() if of_part else library._get_module_for_linking()
            module.link_in(linked, preserve=True)
        return module


class Whole(JITCodeLibrary):
    """The code of a function with that of all its callees: optimized once, and turned into machine code."""

    def finalize(self) -> None:
        """Link each part once, at whatever level it is called."""
        libraries = _all_parts(self._linking_libraries)
        for part in libraries:
            if isinstance(part, Part):
                self._final_module.link_in(part.own_module(), preserve=True)
        self._linking_libraries = [one for one in libraries if not isinstance(one, Part)]
        super().finalize()  # type: ignore[no-untyped-call]


def _all_parts(libraries: Sequence[Any]) -> list[Any]:
    """Return libraries, and the libraries that parts among them call."""
    found, ahead = dict[Any, None](), list(libraries)
    while ahead:
        library = ahead.pop(0)
        if library not in found:
            found[library] = None
            ahead += library._linking_libraries if isinstance(library, Part) else ()
    return list(found)


class WholeCompiler(Compiler):
    """Numba's own compiler, for functions that Python calls or that are called at their address."""

    library: type[JITCodeLibrary] = Whole

    def define_pipelines(self) -> Any:
        """Return numba's own passes, and set the destination of their code."""
        state = self.state
        state.library = self.library(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        return super().define_pipelines()  # type: ignore[no-untyped-call]


class PartCompiler(WholeCompiler):
    """The compiler of functions that compiled functions call."""

    library = Part
