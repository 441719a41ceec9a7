"""The methods of a world in one object file, for another machine: WebAssembly, or a program in C.

The functions of the law are compiled once more, for no machine yet and without reference counts: all arrays
lie in the record of the world, which its caller owns. Numba wraps each method for Python. Here a function
`void method(world)` takes the place of the wrapper, and everything that it does not reach goes.
"""

from collections.abc import Iterable, Mapping
from dis import get_instructions
from types import FunctionType
from typing import Any

import llvmlite.binding as llvm  # type: ignore[import-untyped]
import numba
from numba import types
from numba.extending import intrinsic
from numba.np.arrayobj import np_cfarray

from rmrc.law.compiling import Array, Method, portably
from rmrc.law.record import spectrum_type, world_type

_numba: Any = numba
_types: Any = types
_intrinsic: Any = intrinsic

# A method that does nothing, in the place of one of MuJoCo's, which takes a model and its data.
NOTHING = "nothing"


def name_of(method: Method) -> str:
    """Return the name of a method in an object: its module and function."""
    function = method.function
    return f"{function.__module__.rpartition('.')[2]}.{function.__name__}"


def object_file(methods: Iterable[Method], capacity: int, triple: str) -> bytes:
    """Return an object file with some methods.

    Args:
        methods: The methods.
        capacity: Number of joints that the record of a world holds.
        triple: The machine, as LLVM names it.
    """
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    is_page = triple.startswith("wasm")
    machine = llvm.Target.from_triple(triple).create_target_machine(
        opt=3, reloc="static" if is_page else "pic"
    )
    module = _module(methods, capacity, machine)
    tuning = llvm.create_pipeline_tuning_options(speed_level=2)
    tuning.loop_vectorization = tuning.slp_vectorization = False
    passes = llvm.create_pass_builder(machine, tuning)
    passes.getModulePassManager().run(module, passes)
    module.verify()
    return bytes(machine.emit_object(module))


def _module(methods: Iterable[Method], capacity: int, machine: Any) -> Any:
    """Return the methods as one module of LLVM for a machine, not optimized yet."""
    records = {"world": world_type(capacity), "spectrum": spectrum_type(capacity)}
    kinds = {name: _numba.from_dtype(record) for name, record in records.items()}
    kinds |= {"model": _types.voidptr, "data": _types.voidptr, "number": _types.int32}
    copies: dict[Any, Any] = {}
    head = f'target triple = "{machine.triple}"\ntarget datalayout = "{machine.target_data}"\n'
    whole = llvm.parse_assembly(f"{head}define void @{NOTHING}(i64 %model, i64 %data) {{\n  ret void\n}}")
    inner = {}
    with portably() as flags:
        for method in methods:
            function = method.function
            names = function.__code__.co_varnames[: function.__code__.co_argcount]
            signature = _types.void(*(kinds[name] for name in names))
            made = _numba.cfunc(signature, **flags)(_copy(function, copies, flags))
            part = llvm.parse_assembly(made.inspect_llvm())
            part.triple, part.data_layout = machine.triple, str(machine.target_data)
            inner[name_of(method)] = made.native_name.removeprefix("cfunc.")
            part.get_function(inner[name_of(method)]).linkage = "weak_odr"  # others could be dropped
            whole.link_in(part)
    for thing in [*whole.functions, *whole.global_variables]:
        if not thing.is_declaration and thing.name != NOTHING:
            thing.linkage = "internal"
    thunks = [head]
    for name, mangled in inner.items():
        function = whole.get_function(mangled)
        function.linkage = "external"
        kinds_of = [str(argument.type) for argument in function.arguments]
        taken = ", ".join(f"{kind} %{i}" for i, kind in enumerate(kinds_of[2:]))
        thunks += [
            f"declare i32 @{mangled}({', '.join(kinds_of)})",
            f'define void @"{name}"({taken}) {{',
            "  %result = alloca ptr",
            "  %error = alloca ptr",
            f"  %status = call i32 @{mangled}(ptr %result, ptr %error, {taken})",
            "  ret void",
            "}",
        ]
    whole.link_in(llvm.parse_assembly("\n".join(thunks)))
    for mangled in inner.values():
        whole.get_function(mangled).linkage = "internal"
    return whole


def _typed_array(typing: Any, address: Any, shape: Any, dtype: Any) -> Any:  # noqa: ARG001 - as numba calls it
    return _types.Array(dtype.dtype, len(shape), "C")(address, shape, dtype), np_cfarray


# As numba's own, which without counts could not return an array.
_carray: Any = _intrinsic(_typed_array)


def globals_of(function: Any) -> set[str]:
    """Return the names of modules that a function reads; attributes may have the same names."""
    return {step.argval for step in get_instructions(function) if step.opname == "LOAD_GLOBAL"}


def _copy(function: Any, copies: dict[Any, Any], flags: Mapping[str, Any]) -> Any:
    """Return a copy of a function that calls copies of the functions that it calls, compiled with flags."""
    names = {"carray": _carray}
    for name in globals_of(function):
        called = getattr(function.__globals__.get(name), "py_func", None)
        if called is not None and called not in copies:
            # without counts no function returns an array: such a one becomes a part of its callers
            inline = "always" if called.__annotations__.get("return") == Array else "never"
            copies[called] = _numba.njit(inline=inline, **flags)(_copy(called, copies, flags))
        if called is not None:
            names[name] = copies[called]
    return FunctionType(
        function.__code__, {**function.__globals__, **names}, function.__name__, function.__defaults__
    )
