"""How the robot moves: kernels, the corrective process, and execution of solutions.

Here LLVM is told how to compile, before Numba first asks it for machine code. Only how fast the
kernels are hangs on it. A program that has compiled something else with Numba before it imports
this package keeps the vectors that LLVM prefers.
"""

from __future__ import annotations

import sys
import warnings
from typing import Any

from llvmlite import binding  # which Numba brings, in the one version that it takes


def import_numba() -> Any:
    """Numba's settings; those of a file in the folder where one stands, which may be a stranger's,
    are not read: neither now nor before it compiles."""
    modules: dict[str, Any] = sys.modules
    kept = {name: modules[name] for name in ("yaml",) if name in modules}
    modules["yaml"] = None  # nothing reads such files
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "A Numba config file is found")
            from numba.core import config
    finally:
        del modules["yaml"]
        modules.update(kept)
    config._config_fname = ""
    return config


_config = import_numba()
from numba.core.codegen import get_host_cpu_features  # noqa: E402

# Loops over the links of an arm are unrolled, or the loop over lanes around them could not be
# made of vector instructions: LLVM's own bound ends that at four links.
binding.set_option("coartic", "-unroll-threshold=1000")
# Nor is the first lane taken out of a loop over whole vectors, which would leave seven over.
binding.set_option("coartic", "-unroll-peel-max-count=0")

# Vectors have 512 bits where there are any: on Intel's processors LLVM would prefer 256, with
# which kinematics take 1.5 times as long.
_features = get_host_cpu_features()
if _config.CPU_FEATURES is None and "+avx512f" in _features.split(","):
    _config.CPU_FEATURES = f"{_features},-prefer-256-bit"
