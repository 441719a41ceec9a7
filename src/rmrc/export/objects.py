"""The methods of a world in one object file, for another machine: WebAssembly, or a program in C.

The functions of the law are compiled once more, for no machine yet, and count no references. Numba wraps each
method for Python. Here a function `void method(world)` takes the place of the wrapper, and everything that it
does not reach goes.
"""

from collections.abc import Iterable, Mapping, Sequence
from dis import get_instructions
from types import FunctionType
from typing import Any

import llvmlite.binding as llvm  # type: ignore[import-untyped]
import numba

from rmrc.law.compiling import Method, portably

_numba: Any = numba

# A method that does nothing, in the place of one of MuJoCo's, which takes a model and its data.
NOTHING = "nothing"
# Numba counts references to arrays, of which nobody owns any: all lie in the record of the world.
_UNCOUNTED = "".join(
    f"define void @NRT_{count}(ptr %array) {{\n  ret void\n}}\n" for count in ("incref", "decref")
)


def name_of(method: Method) -> str:
    """Return the name of a method in an object: its module and function."""
    function = method.function
    return f"{function.__module__.rpartition('.')[2]}.{function.__name__}"


def program(methods: Iterable[Method], capacity: int) -> bytes:
    """Return some methods for no machine yet, as bitcode of LLVM, each under its name.

    Args:
        methods: The methods.
        capacity: Number of joints that the record of a world holds.
    """
    copies: dict[Any, Any] = {}
    thunks = [f"define void @{NOTHING}(i64 %model, i64 %data) {{\n  ret void\n}}"]
    whole: Any = None
    with portably() as flags:
        for name, method in {name_of(method): method for method in methods}.items():
            made = _numba.cfunc(method.signature(capacity), **flags)(_copy(method.function, copies, flags))
            part, mangled = llvm.parse_assembly(made.inspect_llvm()), made.native_name.removeprefix("cfunc.")
            part.get_function(mangled).linkage = "weak_odr"  # a weaker function could be dropped
            thunks.append(_thunk(name, mangled, part))
            whole = whole or llvm.parse_assembly(_head(part) + _UNCOUNTED)
            whole.link_in(part)
    whole.link_in(llvm.parse_assembly("\n".join([_head(whole), *thunks])))
    return bytes(whole.as_bitcode())


def _head(module: Any) -> str:
    return f'target triple = "{module.triple}"\ntarget datalayout = "{module.data_layout}"\n'


def _thunk(name: str, mangled: str, part: Any) -> str:
    """Return a function in the language of LLVM that calls numba's, which first takes places of results."""
    types_of = [str(argument.type) for argument in part.get_function(mangled).arguments]
    taken = ", ".join(f"{type_} %{i}" for i, type_ in enumerate(types_of[2:]))
    return f"""declare i32 @{mangled}({", ".join(types_of)})
define void @"{name}"({taken}) {{
  %result = alloca ptr
  %error = alloca ptr
  %status = call i32 @{mangled}(ptr %result, ptr %error, {taken})
  ret void
}}"""


def object_file(code: bytes, triple: str, exports: Sequence[str], text: str = "") -> bytes:
    """Return an object file for a machine.

    Args:
        code: What `program` returned.
        triple: The machine, as LLVM names it.
        exports: Names of the functions that others may call.
        text: Further functions in the language of LLVM.
    """
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    reloc = "static" if triple.startswith("wasm") else "pic"
    machine = llvm.Target.from_triple(triple).create_target_machine(opt=3, reloc=reloc, codemodel="small")
    module = llvm.parse_bitcode(code)
    module.triple, module.data_layout = machine.triple, str(machine.target_data)
    module.link_in(llvm.parse_assembly(_head(module) + text))
    for thing in [*module.functions, *module.global_variables]:
        if not thing.is_declaration:
            thing.linkage = "external" if thing.name in exports else "internal"
    tuning = llvm.create_pipeline_tuning_options(speed_level=2)
    tuning.loop_vectorization = tuning.slp_vectorization = False
    passes = llvm.create_pass_builder(machine, tuning)
    passes.getModulePassManager().run(module, passes)
    module.verify()
    return bytes(machine.emit_object(module))


def _copy(function: Any, copies: dict[Any, Any], flags: Mapping[str, Any]) -> Any:
    """Return a copy of a function that calls copies of the functions that it calls, compiled with flags."""
    names = {}
    for name in globals_of(function):
        called = getattr(function.__globals__.get(name), "py_func", None)
        if called is not None and called not in copies:
            copies[called] = _numba.njit(**flags)(_copy(called, copies, flags))
        if called is not None:
            names[name] = copies[called]
    return FunctionType(
        function.__code__, {**function.__globals__, **names}, function.__name__, function.__defaults__
    )


def globals_of(function: Any) -> set[str]:
    """Return the names of modules that a function reads; attributes may have the same names."""
    return {step.argval for step in get_instructions(function) if step.opname == "LOAD_GLOBAL"}
