"""A function that is compiled at its first call, once for each combination of types.

What it calls is compiled on the way, but no further than it takes to link it in
(`library`). Called itself later, from Python, it is compiled again, in full.
"""

from __future__ import annotations

import gc
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

import numba
from numba.core import registry
from numba.core.compiler import CompileResult
from numba.core.compiler_lock import global_compiler_lock

from decmcts.jit.library import (
    borrows,
    compiling,
    compiling_kernel,
    hand_environments,
    set_attribute,
)
from decmcts.jit.store import Store

OnCompiling = Callable[[str], None]
"""Told the name of each kernel about to be compiled."""

Maker = Callable[[Callable[[], Any]], Any]
"""Makes a call in another thread and returns its result."""

_Dispatcher: Any = registry.CPUDispatcher  # numba has no types of its own
_Result: Any = CompileResult
_lock: Any = global_compiler_lock
_COUNTS = "_nrt"  # numba's option: whether to count who holds an array
_reports: list[OnCompiling] = []
_compiled_now: list[str] = []  # kernels this process makes, or waits for
_turn = threading.Lock()  # held while kernels of another thread come first
_giving_way: list[int] = []  # threads that wait for it, none of which may hold it
_makers: dict[int, Maker] = {}  # threads, and what has their kernels made in another one


@contextmanager
def reported_to(report: OnCompiling) -> Iterator[None]:
    """Tell `report` of every kernel that is compiled meanwhile, in this process."""
    _reports.append(report)
    try:
        yield
    finally:
        _reports.remove(report)


def at_work() -> bool:
    """Say whether a kernel is being compiled, or waited for, in this process."""
    return bool(_compiled_now)


@contextmanager
def compiled_first() -> Iterator[None]:
    """Let kernels be loaded or made before those of threads that give way, but for one begun."""
    with _turn:
        yield


@contextmanager
def giving_way() -> Iterator[None]:
    """Let this thread's kernels wait while others come first."""
    thread = threading.get_ident()
    _giving_way.append(thread)
    try:
        yield
    finally:
        _giving_way.remove(thread)


@contextmanager
def made_by(maker: Maker) -> Iterator[None]:
    """Have another thread load or make this thread's kernels.

    For threads of low priority: all others would wait for them as long as they hold the compiler.
    """
    thread = threading.get_ident()
    _makers[thread] = maker
    try:
        yield
    finally:
        del _makers[thread]


class Kernel(_Dispatcher):  # type: ignore[misc]  # untyped base
    """A compiled function whose machine code is kept in a store."""

    def __init__(
        self,
        function: Callable[..., Any],
        store: Store,
        *,
        inlined: bool = False,
        apart: bool = False,
    ) -> None:
        options = {"nopython": True, "nogil": True, "no_cfunc_wrapper": True}
        if inlined or apart:
            set_attribute(function.__name__, "alwaysinline" if inlined else "noinline")
        super().__init__(py_func=function, targetoptions=options)
        self._store = store
        self._borrows: bool | None = None  # not known yet

    def compile(self, signature: Any) -> Any:
        """Return what runs this combination of types, known, loaded or made."""
        if (maker := _makers.get(threading.get_ident())) is not None:
            return maker(partial(self.compile, signature))
        if threading.get_ident() in _giving_way and not _lock.is_locked():
            with _turn:  # a thread that is compiling a kernel waits for none on the way to it
                pass
        with global_compiler_lock:
            types = tuple(signature)
            known = self.overloads.get(types)
            if known is not None and (compiling() or not _only_linked(known)):
                return known.entry_point
            if compiling():
                return self._made(signature)
            key = self._key(types)
            _compiled_now.append(key[0])
            try:
                found = self._store.read_or_claim(key)
                return self._make(types, key) if found is None else self._take(found)
            finally:
                _compiled_now.pop()
                self._store.release()

    def add_overload(self, result: Any) -> None:
        """Keep a result, for calls from Python too if it has machine code."""
        if _only_linked(result):
            self.overloads[tuple(result.signature.args)] = result
        else:
            super().add_overload(result)

    def _make(self, types: tuple[Any, ...], key: tuple[str, ...]) -> Any:
        """Compile in full and keep the machine code."""
        for report in _reports:
            report(self.py_func.__name__)
        self.overloads.pop(types, None)
        with compiling_kernel(self.py_func.__qualname__), _no_collection():
            self._made(types)
        made = self.overloads[types]
        hand_environments(made.library)
        if not made.library.has_dynamic_globals:
            self._store.write(key, made._reduce())
        return made.entry_point

    def _made(self, signature: Any) -> Any:
        """Compile, without counting who holds an array where the function only borrows them.

        Where that fails the function makes one in a way that its text does not show.
        """
        if self._borrows is None:
            self._borrows = borrows(self.py_func, compiled=Kernel)
        self.targetoptions[_COUNTS] = not self._borrows  # else what calls this one says
        try:
            made = super().compile(signature)
        except numba.NumbaError:
            if not self._borrows:
                raise
        else:
            if self._borrows:
                self._refuse_counted()
            return made
        self._borrows, self.targetoptions[_COUNTS] = False, True
        self._compiler._failed_cache.clear()
        return super().compile(signature)

    def _refuse_counted(self) -> None:
        """Raise TypeError where a function says that it returns numbers and returns an array."""
        models = self.targetctx.data_model_manager
        for result in self.overloads.values():
            returned = result.signature.return_type
            if models[returned].contains_nrt_meminfo():
                name = self.py_func.__name__
                raise TypeError(f"{name} returns {returned}, its annotation says numbers")

    def _take(self, found: Any) -> Any:
        """Use machine code from the store."""
        self.targetctx.refresh()
        result = _Result._rebuild(self.targetctx, *found)
        self.targetctx.insert_user_function(result.entry_point, result.fndesc, [result.library])
        self.add_overload(result)
        return result.entry_point

    def _key(self, types: tuple[Any, ...]) -> tuple[str, ...]:
        """Name the machine code: the function, its types, the compiler and the processor."""
        self.targetctx.refresh()
        function = f"{self.py_func.__module__}.{self.py_func.__qualname__}"
        return (function, *map(str, types), *compiler_and_processor())


def compiler_and_processor() -> tuple[str, ...]:
    """Return what machine code depends on besides its source."""
    processor = registry.cpu_target.target_context.codegen().magic_tuple()
    return (numba.__version__, *map(str, processor))


def _only_linked(result: Any) -> bool:
    return getattr(result.library, "only_linked", False)


@contextmanager
def _no_collection() -> Iterator[None]:
    """Keep the garbage collector from the compiler's many objects, nearly all of which live on."""
    collects = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collects:
            gc.enable()
