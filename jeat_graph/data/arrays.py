"""Names of the array types; the leaf that every other module may import."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

FloatArray: TypeAlias = npt.NDArray[np.float64]
IntArray: TypeAlias = npt.NDArray[np.int64]
BoolArray: TypeAlias = npt.NDArray[np.bool_]
TextArray: TypeAlias = npt.NDArray[np.str_]
#: Arrays of records (structured dtypes), such as `filters.measurement.MEASUREMENT`.
RecordArray: TypeAlias = npt.NDArray[np.void]
