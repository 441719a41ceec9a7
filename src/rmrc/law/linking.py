"""How compiled functions are linked: each entry is optimized once, with all that it calls.

Numba is made for functions of a few lines that are compiled one by one. Here one entry calls a hundred small
ones, and most of the time goes into what numba does between its own steps. The classes and the memory below
leave out steps that do not change the machine code.
"""

from collections.abc import Sequence
from types import CodeType
from typing import Any, cast

from llvmlite import binding, ir  # type: ignore[import-untyped]
from numba import config
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.compiler_machinery import PassManager, _pass_registry
from numba.core.errors import NumbaError
from numba.core.typed_passes import NopythonRewrites
from numba.core.untyped_passes import InlineClosureLikes

from rmrc.law.brisk import IS_KNOWN, plainly


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

    # Whether it always returns the code of success.
    raises_nothing = True

    def add_ir_module(self, ir_module: Any) -> None:
        """Add code, and note whether it can raise."""
        own = (one for one in ir_module.functions if one.blocks)
        ends = (block.terminator for one in own for block in one.blocks)
        returned = (one.return_value for one in ends if isinstance(one, ir.Ret))
        if not all(isinstance(one, ir.Constant) and one.constant == 0 for one in returned):
            self.raises_nothing = False
        super().add_ir_module(ir_module)  # type: ignore[no-untyped-call]

    def _optimize_functions(self, ll_module: Any) -> None:
        """Do nothing: functions are optimized once, where they are linked."""
        ll_module.data_layout = self._codegen._data_layout

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
    """The code of a function with that of all its callees: optimized once, and turned into machine code.

    Its loops are neither unrolled nor vectorized. They are a few joints long: the code for longer ones takes
    a third of the time of optimizing, and makes no tick faster.
    """

    has_long_loops = False

    def finalize(self) -> None:
        """Link each part once, at whatever level it is called."""
        libraries = _all_parts(self._linking_libraries)
        for part in libraries:
            if isinstance(part, Part):
                self._final_module.link_in(part.own_module(), preserve=True)
        self._linking_libraries = [one for one in libraries if not isinstance(one, Part)]
        super().finalize()  # type: ignore[no-untyped-call]

    def _optimize_functions(self, ll_module: Any) -> None:
        """Do nothing: all code is optimized together, once."""
        ll_module.data_layout = self._codegen._data_layout

    def _optimize_final_module(self) -> None:
        """Optimize once; numba would first optimize cheaply, to find needless counts of references."""
        codegen: Any = self._codegen
        options = binding.create_pipeline_tuning_options(speed_level=int(cast(Any, config).OPT))
        options.loop_vectorization = options.loop_unrolling = self.has_long_loops
        options.slp_vectorization = False
        builder = binding.create_pass_builder(codegen._tm, options)
        passes = builder.getModulePassManager()
        passes.add_refprune_pass()
        passes.run(self._final_module, builder)


class Long(Whole):
    """The code of a function that goes through thousands of rows: its loops are unrolled and vectorized."""

    has_long_loops = True


def _all_parts(libraries: Sequence[Any]) -> list[Any]:
    """Return libraries, and the libraries that parts among them call."""
    found, ahead = dict[Any, None](), list(libraries)
    while ahead:
        library = ahead.pop(0)
        if library not in found:
            found[library] = None
            ahead += library._linking_libraries if isinstance(library, Part) else ()
    return list(found)


class _Passes(PassManager):
    """Numba's passes, one after the other, without its work in between.

    Numba reports each pass with the names of all argument types, and the name of a record type lists a
    hundred fields. It also finds the live variables after each pass; the last pass before the code finds
    them anyway.
    Functions that make no array have no array expressions to rewrite, and few contain functions.
    """

    def run(self, state: Any) -> None:
        """Run all passes on the state of a compiler."""
        is_plain = IS_KNOWN and not state.flags.nrt
        with plainly(is_plain):
            in_turn(self, state, is_plain)


def in_turn(manager: Any, state: Any, is_plain: bool = True) -> None:
    """Run the passes of a manager one after the other; a function that makes no arrays needs not all."""
    left_out = list[Any]()
    if is_plain:
        has_inner = any(isinstance(one, CodeType) for one in state.func_id.code.co_consts)
        left_out = [NopythonRewrites] if has_inner else [NopythonRewrites, InlineClosureLikes]
    registered: Any = _pass_registry
    for one, does in manager.passes:
        if one in left_out:
            continue
        done = registered.get(one).pass_inst
        done.analysis = manager._analysis
        try:
            for step in (done.run_initialization, done.run_pass, done.run_finalizer):
                step(state)
        except NumbaError as error:
            manager._patch_error(f"Failed in {manager.pipeline_name} mode pipeline (step: {does})", error)
            raise


class WholeCompiler(Compiler):
    """Numba's own compiler, for functions that Python calls or that are called at their address."""

    library: type[JITCodeLibrary] = Whole

    def define_pipelines(self) -> Any:
        """Return numba's own passes, and set the destination of their code."""
        state = self.state
        state.library = self.library(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        (own,) = super().define_pipelines()  # type: ignore[no-untyped-call]
        passes = _Passes(own.pipeline_name)  # type: ignore[no-untyped-call]
        passes.passes = own.passes
        passes.finalize()  # type: ignore[no-untyped-call]
        return [passes]


class PartCompiler(WholeCompiler):
    """The compiler of functions that compiled functions call."""

    library = Part


class LongCompiler(WholeCompiler):
    """The compiler of functions that go through thousands of rows."""

    library = Long
