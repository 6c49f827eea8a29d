"""Compiled functions without machine code of their own, for those that only compiled ones call.

Numba links what a function calls into the function itself, and makes machine code of the whole.
It would make machine code of the called function alone too, which is never run.
"""

from __future__ import annotations

from typing import Any

from llvmlite.binding import parse_bitcode
from numba import _dynfunc
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, CompileResult, DefaultPassBuilder, compile_result
from numba.core.compiler_machinery import LoweringPass, register_pass
from numba.core.typed_passes import AnnotateTypes, NativeLowering


class _LinkedLibrary(JITCodeLibrary):
    """LLVM code that is kept and linked.

    A function that calls no other such one is optimised here, once for all of its callers. One that
    does would be optimised with copies of them all, which its callers do anyhow.
    """

    def _optimize_final_module(self) -> None:
        if not any(isinstance(called, _LinkedLibrary) for called in self._linking_libraries):
            super()._optimize_final_module()

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True

    def serialize_using_object_code(self) -> tuple[Any, ...]:
        return self.serialize_using_bitcode()

    def read(self, code: bytes) -> None:
        """Take what :meth:`serialize_using_object_code` gave."""
        self._final_module = parse_bitcode(code)
        self._finalize_final_module()


def _empty(description: Any, environment: Any, library: _LinkedLibrary) -> Any:
    """The function object that Numba's dispatcher wants, with nothing behind it."""
    name, module = description.qualname, description.lookup_module()
    return _dynfunc.make_function(module, name, "", 0, environment, (library,))


def is_linked(payload: tuple[Any, ...]) -> bool:
    """Whether what Numba's cache has kept of a function comes from :class:`LinkedCompiler`.

    Args:
        payload: library, description, environment and so on.
    """
    return bool(payload[0][1] == "bitcode")


def rebuild(context: Any, payload: tuple[Any, ...]) -> CompileResult:
    """The function that the cache has kept. Numba's own reader would make machine code of it.

    Args:
        context: of the target.
        payload: what :func:`is_linked`.
    """
    (name, _, code), description, environment, signature, object_mode, lifted = payload[:6]
    annotation, reload_init, referenced = payload[6:]
    library = _LinkedLibrary(context.codegen(), name)
    library.read(code)
    return compile_result(
        target_context=context,
        typing_context=context.typing_context,
        library=library,
        environment=environment,
        entry_point=_empty(description, environment, library),
        fndesc=description,
        type_annotation=annotation,
        signature=signature,
        objectmode=object_mode,
        lifted=lifted,
        reload_init=reload_init,
        referenced_envs=referenced,
    )


@register_pass(mutates_CFG=False, analysis_only=False)
class _MakeLibrary(LoweringPass):
    """Has the code written into a :class:`_LinkedLibrary`."""

    _name = "make_linked_library"

    def __init__(self) -> None:
        super().__init__()

    def run_pass(self, state: Any) -> bool:
        state.library = _LinkedLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.flags.no_compile = True
        return True


@register_pass(mutates_CFG=False, analysis_only=False)
class _MakeFunction(LoweringPass):
    """Has the dispatcher know the function, and callers link it."""

    _name = "make_linked_function"

    def __init__(self) -> None:
        super().__init__()

    def run_pass(self, state: Any) -> bool:
        made = state.cr
        function = _empty(made.fndesc, made.env, state.library)
        state.targetctx.insert_user_function(function, made.fndesc, [state.library])
        state.cr = made._replace(cfunc=function)
        return True


class LinkedCompiler(CompilerBase):
    """Numba's compiler, without the last step."""

    def define_pipelines(self) -> list[Any]:
        """Numba's passes with two more."""
        pipeline = DefaultPassBuilder.define_nopython_pipeline(self.state)
        pipeline.add_pass_after(_MakeLibrary, AnnotateTypes)
        pipeline.add_pass_after(_MakeFunction, NativeLowering)
        pipeline.finalize()
        return [pipeline]
