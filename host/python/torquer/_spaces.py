"""Base classes and spaces of environments: Gymnasium's, or plain ones where it is not installed."""

from __future__ import annotations

from copy import deepcopy
from typing import Any, Dict, Optional, Tuple, TypeVar

import numpy as np
import numpy.typing as npt

from . import Error

_Self = TypeVar("_Self", bound="CopiedWhole")

try:
    import gymnasium as gymnasium  # type: ignore[import]

    _ClosedBase: Any = gymnasium.error.ClosedEnvironmentError

    Env: Any = gymnasium.Env
    VectorEnv: Any = gymnasium.vector.VectorEnv
    Box: Any = gymnasium.spaces.Box
    DictSpace: Any = gymnasium.spaces.Dict
except ImportError:
    gymnasium = None

    class _PlainBox:
        """Part of gymnasium.spaces.Box that the environments and simple agents use."""

        def __init__(
            self, low: Any, high: Any, shape: Optional[Tuple[int, ...]] = None, dtype: Any = None
        ) -> None:
            self.dtype = np.dtype(dtype or np.float32)
            self.shape = tuple(np.shape(low)) if shape is None else shape
            self.low = np.broadcast_to(np.asarray(low, self.dtype), self.shape)
            self.high = np.broadcast_to(np.asarray(high, self.dtype), self.shape)
            self._random = np.random.default_rng()

        def __repr__(self) -> str:
            return f"Box({self.low.min()}, {self.high.max()}, {self.shape}, {self.dtype})"

        def seed(self, seed: Optional[int] = None) -> None:
            self._random = np.random.default_rng(seed)

        def sample(self) -> npt.NDArray[Any]:
            if self.dtype == np.uint8:
                return self._random.integers(0, 256, self.shape, dtype=np.uint8)
            low = np.maximum(self.low, -1e6)
            high = np.minimum(self.high, 1e6)
            return self._random.uniform(low, high).astype(self.dtype)

        def contains(self, x: Any) -> bool:
            return bool(
                isinstance(x, np.ndarray)
                and x.dtype == self.dtype
                and x.shape == self.shape
                and (x >= self.low).all()
                and (x <= self.high).all()
            )

    class _PlainDict(Dict[str, Any]):
        """Part of gymnasium.spaces.Dict that the environments and simple agents use."""

        @property
        def spaces(self) -> Dict[str, Any]:
            return self

        def seed(self, seed: Optional[int] = None) -> None:
            for space in self.values():
                space.seed(seed)

        def sample(self) -> Dict[str, Any]:
            return {name: space.sample() for name, space in self.items()}

        def contains(self, x: Any) -> bool:
            return isinstance(x, dict) and x.keys() == self.keys() and all(self[name].contains(x[name]) for name in self)

    Env = object
    VectorEnv = object
    Box = _PlainBox
    DictSpace = _PlainDict
    _ClosedBase = Exception


class ClosedEnvironmentError(Error, _ClosedBase):  # type: ignore[misc]
    """A call of an environment after close(). With Gymnasium it is also Gymnasium's error of this name."""


def refuse_closed(is_closed: bool, call: str) -> None:
    """Refuses a call of a closed environment."""
    if is_closed:
        raise ClosedEnvironmentError(f"{call}() of an environment after close(); make another environment")


class CopiedWhole:
    """Objects that copy.copy() copies as copy.deepcopy() does, so that no copy shares a state with its original."""

    def __copy__(self: _Self) -> _Self:
        return deepcopy(self)
