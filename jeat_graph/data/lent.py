"""Named tuples of arrays that Python owns and compiled kernels borrow, by their address.

A step of the tracker is some thirty kernels that take the state of all tracks, over a hundred arrays. numba
hands tuples over field by field, and each kernel counts the references to every array at its entry and at its
end: of a step without any track that was four fifths of the time. Who calls the step holds the arrays as
long as it runs, so nobody inside has to count, and an address is enough to find them.
"""

from __future__ import annotations

import hashlib
import re
from typing import Any, TypeVar

from llvmlite import ir
from numba.core import cgutils, types
from numba.core.datamodel import models
from numba.core.imputils import impl_ret_borrowed, lower_getattr_generic
from numba.extending import NativeValue, box, register_model, typeof_impl, unbox

_Class = TypeVar("_Class", bound=type[tuple[Any, ...]])
# numba writes the second definition of a variable, and what merges two, with a number behind the name.
_DEFINED_AGAIN = re.compile(r"\.\d+$")


class Lent(types.NamedTuple):
    """The type of a named tuple that kernels borrow."""

    def __init__(self, fields: tuple[Any, ...], made_of: type[Any]) -> None:
        super().__init__(fields, made_of)
        self.name = f"lent {self.name}"

    @property
    def mangling_args(self) -> tuple[str, tuple[()]]:
        """What stands for the type in names of kernels; else these have ten thousand letters."""
        made_of = self.instance_class
        whole = f"{made_of.__module__} {made_of.__qualname__} {self.fields} {self.name}"
        return f"{made_of.__name__}_{hashlib.sha256(whole.encode()).hexdigest()[:16]}", ()


def lent(made_of: _Class) -> _Class:
    """Have kernels borrow the named tuples of this class that Python gives them.

    A kernel may take such a tuple and hand it on, the whole of it or a lent tuple in it; it can neither
    return it to Python nor keep it in a list or a generator. A tuple of the class that a kernel makes itself
    is an ordinary one, of another type to numba.
    """

    @typeof_impl.register(made_of)
    def _(value: Any, context: Any) -> Lent | None:
        fields = tuple(typeof_impl(field, context) for field in value)
        return None if None in fields else Lent(fields, made_of)

    return made_of


@register_model(Lent)
class LentModel(models.TupleModel):
    """Laid out as any named tuple; as an argument its address, and nobody counts references to its parts."""

    def traverse(self, builder: Any) -> list[Any]:
        """Return that of which references are counted: nothing."""
        return []

    def as_data(self, builder: Any, value: Any) -> Any:
        """Refuse to be written where it would outlive the call: in a list, in the state of a generator."""
        raise TypeError(f"{self._fe_type.instance_class.__name__} is lent to kernels: they can't keep it")

    def get_return_type(self) -> Any:
        """Return the type of what one kernel returns to another: the tuple, as it is."""
        return self.get_value_type()

    def as_return(self, builder: Any, value: Any) -> Any:
        """Return it as it is."""
        return value

    def from_return(self, builder: Any, value: Any) -> Any:
        """Return it as it is."""
        return value

    def get_argument_type(self) -> Any:
        """Return the type of an argument."""
        return self.get_value_type().as_pointer()

    def as_argument(self, builder: Any, value: Any) -> Any:
        """Return what a kernel is given: the owner's address, or where that isn't known that of a copy."""
        known = _address(builder, value)
        return cgutils.alloca_once_value(builder, value) if known is None else known

    def from_argument(self, builder: Any, value: Any) -> Any:
        """Return the tuple at an address; what of it nobody asks for, the compiler leaves out."""
        # While a kernel runs nobody changes which arrays these are, and no address of them stays behind.
        value.add_attribute("noalias")
        try:
            value.add_attribute("captures(none)")
        except ValueError:  # its name before LLVM 20
            value.add_attribute("nocapture")
        return builder.load(value)


@lower_getattr_generic(Lent)
def _field(context: Any, builder: Any, kind: Lent, value: Any, name: str) -> Any:
    """Read one field where it lies; of a tuple in a tuple the place is all that is needed."""
    place = kind.fields.index(name)
    whole = _address(builder, value)
    if whole is None or isinstance(kind[place], Lent):
        part = builder.extract_value(value, place)
    else:
        part = builder.load(cgutils.gep_inbounds(builder, whole, 0, place))
    return impl_ret_borrowed(context, builder, kind[place], part)


def _address(builder: Any, value: Any) -> Any:
    """Where the owner has the tuple that is `value`, or None if that can't be told."""
    if isinstance(value, ir.instructions.ExtractValue):
        whole = _address(builder, value.operands[0])
        return None if whole is None else cgutils.gep_inbounds(builder, whole, 0, *value.indices)
    if not isinstance(value, ir.instructions.LoadInstr):
        return None
    place = value.operands[0]
    if isinstance(place, ir.instructions.AllocaInstr):
        origin = _only_value(builder, place)
        return None if origin is None else _address(builder, origin)
    return place if isinstance(place, ir.Argument) else None


def _only_value(builder: Any, variable: Any) -> Any:
    """Return what is assigned to a variable that is defined once, or None."""
    if _DEFINED_AGAIN.search(variable.name):
        return None
    stored = [
        instruction.operands[0]
        for block in builder.function.blocks
        for instruction in block.instructions
        if isinstance(instruction, ir.instructions.StoreInstr) and instruction.operands[1] is variable
    ]
    # Variables are set to zero before their definition and after their last use.
    stored = [value for value in stored if not isinstance(value, ir.Constant)]
    return stored[0] if len(stored) == 1 else None


@unbox(Lent)
def _take(kind: Lent, given: Any, c: Any) -> NativeValue:
    """Take a tuple from Python, whose arrays are given back when the kernel has returned."""
    owned = types.NamedTuple(kind.types, kind.instance_class)
    native = c.unbox(owned, given)
    place = cgutils.alloca_once_value(c.builder, native.value)

    def give_back() -> None:
        if native.cleanup is not None:
            native.cleanup()
        c.context.nrt.decref(c.builder, owned, c.builder.load(place))

    return NativeValue(native.value, native.is_error, give_back)


@box(Lent)
def _refuse(kind: Lent, value: Any, c: Any) -> Any:
    """Return nothing to Python: whose array that is was not counted."""
    raise TypeError(f"{kind.instance_class.__name__} is lent to kernels: they can't return it")
