"""Pack pytrees of small arrays into rows of 32-bit words: one array to pass instead of many.

A compiled call from Python takes time for each array that it takes or returns, whatever its size.
For a step of one environment, that is more than the step itself.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

_WORD = np.dtype(np.uint32)


class _Leaf(NamedTuple):
    """An array of the tree: its shape and dtype as numbers, its words, and the kind of keys."""

    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    first: int
    end: int
    keys: Any


class Packing:
    """The layout of a pytree in words. Equal trees have equal packings.

    Attributes:
        words: the number of words in a row.
    """

    def __init__(self, function: Callable[..., Any], *args: Any) -> None:
        """Lay out the return value of a function, which is traced.

        Args:
            function: a function of arrays or their shapes that returns a pytree of numeric
                arrays, bools and random keys.
            *args: its arguments.
        """
        kinds: list[Any] = []

        def numbers(*args: Any) -> Any:
            tree = function(*args)
            kinds.extend(_kind_of_keys(leaf) for leaf in jax.tree.leaves(tree))
            return jax.tree.map(_as_numbers, tree)

        shapes, self._tree = jax.tree.flatten(jax.eval_shape(numbers, *args))
        ends = np.cumsum([0, *map(_size, shapes)]).tolist()
        self._leaves = tuple(
            _Leaf(leaf.shape, np.dtype(leaf.dtype), *place)
            for leaf, *place in zip(shapes, ends[:-1], ends[1:], kinds, strict=True)
        )
        self.words = ends[-1]
        self._record = _record(self._leaves, self.words)
        self._quick = [_quick(leaf) for leaf in self._leaves]
        self._views = tuple({char for char, *_ in self._quick} - {""})
        self._hash = hash((self._tree, self._leaves))

    def __eq__(self, other: object) -> bool:
        """Whether both lay out equal trees in the same way."""
        if not isinstance(other, Packing):
            return NotImplemented
        return self._tree == other._tree and self._leaves == other._leaves

    def __hash__(self) -> int:
        """Computed once, because compiled calls need it every time."""
        return self._hash

    def pack(self, tree: Any) -> jax.Array:
        """Pack a tree into uint32[words], in compiled code."""
        leaves = [_as_words(_as_numbers(leaf)) for leaf in jax.tree.leaves(tree)]
        return jnp.concatenate(leaves) if leaves else jnp.zeros(0, jnp.uint32)

    def unpack(self, row: jax.Array) -> Any:
        """Unpack a tree from uint32[words], in compiled code."""
        return jax.tree.unflatten(self._tree, [_of_words(row, leaf) for leaf in self._leaves])

    def read(self, rows: Any) -> Any:
        """Unpack uint32[N, words] on the host, as new numpy arrays with a leading axis N.

        numpy has no random keys, so keys stay numbers.
        """
        read = np.array(rows).view(self._record)[:, 0]
        arrays = [_read(read[str(i)], leaf.dtype) for i, leaf in enumerate(self._leaves)]
        return jax.tree.unflatten(self._tree, arrays)

    def read_one(self, rows: Any) -> Any:
        """Unpack uint32[1, words] on the host, without the leading axis.

        Bools are Python's, other scalars numpy's, and arrays are new. This calls fewer functions of
        numpy than `read`, each of which takes long to start.
        """
        words = np.asarray(rows)[0].copy()
        numbers, views = words.tolist(), {char: words.view(char) for char in self._views}
        values = [
            views[char][place] if char else numbers[place] != 0 if known else _read_one(words, leaf)
            for char, place, known, leaf in self._quick
        ]
        return jax.tree.unflatten(self._tree, values)


def _kind_of_keys(leaf: Any) -> Any:
    typed = jnp.issubdtype(jnp.result_type(leaf), jax.dtypes.prng_key)
    return jax.random.key_impl(leaf) if typed else None


def _as_numbers(leaf: Any) -> jax.Array:
    return jnp.asarray(leaf) if _kind_of_keys(leaf) is None else jax.random.key_data(leaf)


def _size(leaf: Any) -> int:
    """The number of words of an array; bools and short numbers take one each."""
    return int(np.prod(leaf.shape, dtype=int)) * max(1, leaf.dtype.itemsize // _WORD.itemsize)


def _short(dtype: np.dtype[Any]) -> np.dtype[Any]:
    """The unsigned dtype of the size of a short number."""
    return np.dtype(f"u{dtype.itemsize}")


def _as_words(leaf: jax.Array) -> jax.Array:
    if leaf.dtype == jnp.bool_:
        return leaf.astype(jnp.uint32).reshape(-1)
    if leaf.dtype.itemsize < _WORD.itemsize:
        short = lax.bitcast_convert_type(leaf, _short(leaf.dtype))
        return short.astype(jnp.uint32).reshape(-1)
    return lax.bitcast_convert_type(leaf, jnp.uint32).reshape(-1)


def _of_words(row: jax.Array, leaf: _Leaf) -> jax.Array:
    words = row[leaf.first : leaf.end]
    if leaf.dtype == np.bool_:
        return words.reshape(leaf.shape).astype(jnp.bool_)
    if leaf.dtype.itemsize < _WORD.itemsize:
        words = words.astype(_short(leaf.dtype))
    elif leaf.dtype.itemsize > _WORD.itemsize:
        words = words.reshape(-1, leaf.dtype.itemsize // _WORD.itemsize)
    numbers = lax.bitcast_convert_type(words, leaf.dtype).reshape(leaf.shape)
    return numbers if leaf.keys is None else jax.random.wrap_key_data(numbers, impl=leaf.keys)


def _record(leaves: Sequence[_Leaf], words: int) -> np.dtype[Any]:
    """The numpy dtype of a row."""
    return np.dtype(
        {
            "names": [str(i) for i in range(len(leaves))],
            "formats": [(_kind_in_row(leaf), leaf.shape) for leaf in leaves],
            "offsets": [leaf.first * _WORD.itemsize for leaf in leaves],
            "itemsize": words * _WORD.itemsize,
        }
    )


def _quick(leaf: _Leaf) -> tuple[str, int | slice, bool, _Leaf]:
    """How `read_one` reads an array: a view or "", the index in it, and whether it is one bool."""
    vector, flag = len(leaf.shape) == 1, leaf.shape == () and leaf.dtype == np.bool_
    word = len(leaf.shape) < 2 and leaf.dtype.itemsize == _WORD.itemsize
    place = slice(leaf.first, leaf.end) if vector else leaf.first
    return leaf.dtype.char if word else "", place, flag, leaf


def _read_one(words: np.ndarray, leaf: _Leaf) -> Any:
    """An array of a row uint32[words], or a scalar, that is neither a bool nor made of words."""
    array = np.array(words[leaf.first : leaf.end]).view(_kind_in_row(leaf)).reshape(leaf.shape)
    return _read(array, leaf.dtype)[()]


def _kind_in_row(leaf: _Leaf) -> np.dtype[Any]:
    """The dtype of an array in a row, where short numbers are words."""
    return _WORD if leaf.dtype.itemsize < _WORD.itemsize else leaf.dtype


def _read(array: np.ndarray, dtype: np.dtype[Any]) -> np.ndarray:
    if dtype == np.bool_:
        return array != 0
    if dtype.itemsize < _WORD.itemsize:
        return array.astype(_short(dtype)).view(dtype)
    # In a row, 8-byte numbers may not be aligned, which torch refuses.
    return array if dtype.itemsize == _WORD.itemsize else array.copy()
