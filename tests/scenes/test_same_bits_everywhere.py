"""Scenes come out alike on every machine: none calls what machines round differently."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

SCENES = sorted((Path(__file__).parents[2] / "scenes").glob("*.py"))

ROUNDED_DIFFERENTLY = {
    *("sin", "cos", "tan", "arcsin", "arccos", "arctan", "arctan2", "asin", "acos", "atan", "atan2", "sinh", "cosh"),
    *("tanh", "exp", "exp2", "expm1", "log", "log2", "log10", "log1p", "pow", "power", "float_power", "cbrt", "hypot"),
    *("dot", "matmul", "inner", "outer", "vdot", "tensordot", "einsum", "linalg", "norm"),  # BLAS
    *("sum", "mean", "std", "var", "average", "nansum", "interp", "default_rng", "random"),  # order, or stream
}
"""Names in ``numpy`` or ``math``. Methods of arrays are looked for by the same names."""

ALLOWED = {("fitting.py", "cos"), ("fitting.py", "sin"), ("uniform_draws.py", "random")}
"""``fitting`` rounds them to twelve decimals; ``numpy.random.PCG64`` gives raw bits, whose stream is guaranteed."""


def _breaches(path: Path) -> list[str]:
    found = []
    for node in ast.walk(ast.parse(path.read_text())):
        match node:
            case ast.BinOp(op=ast.MatMult()):
                found.append(f"{path.name}:{node.lineno} multiplies matrices")
            case ast.BinOp(left=ast.Constant(), op=ast.Pow()) | ast.BinOp(op=ast.Pow(), right=ast.Constant(value=2)):
                pass  # of a number, or a square, which is a product
            case ast.BinOp(op=ast.Pow()):
                found.append(f"{path.name}:{node.lineno} raises to a power")
            case ast.Call(func=ast.Attribute(attr="arange"), args=[_, _, *_]):
                found.append(f"{path.name}:{node.lineno} steps by a sum of products, which may be fused")
            case ast.Attribute() if node.attr in ROUNDED_DIFFERENTLY and (path.name, node.attr) not in ALLOWED:
                found.append(f"{path.name}:{node.lineno} calls {node.attr}")
    return found


@pytest.mark.parametrize("path", SCENES, ids=lambda p: p.name)
def test_a_scene_uses_only_what_ieee_754_rounds_in_one_way(path: Path) -> None:
    assert _breaches(path) == []


def test_the_search_finds_what_it_is_for(tmp_path: Path) -> None:
    file = tmp_path / "scene.py"
    file.write_text("import numpy as np\nx = np.sin(1.0)\ny = x @ x\nz = x.sum()\nw = x ** y\nnp.arange(0, 1, 0.1)\n")
    assert len(_breaches(file)) == 5
