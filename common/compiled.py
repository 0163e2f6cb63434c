"""Where numba keeps compiled kernels: in the user's cache, in a folder named after the sources.

Numba's disk cache notices a change of a kernel's own file but not of a kernel that it calls in another file, and would go on running the
old one in silence. A folder per state of the sources cannot be stale, and the package's own folder need not be writable.
"""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

__all__ = ["VARIABLE", "keep_compiled_kernels"]

VARIABLE = "NUMBA_CACHE_DIR"
ROOT = Path(__file__).resolve().parent.parent


def keep_compiled_kernels(root: Path = ROOT) -> None:
    """Point numba at the folder of this state of the sources, unless the environment already names one. Call before numba is imported."""
    if VARIABLE not in os.environ:
        base = os.environ.get("XDG_CACHE_HOME")
        cache = (Path(base) if base else Path.home() / ".cache") / "tolman"
        os.environ[VARIABLE] = str(cache / f"kernels-{digest_of_kernels(root)}")


def digest_of_kernels(root: Path) -> str:
    """16 hex digits of all sources below ``common`` and ``services`` that have kernels."""
    digest = hashlib.sha256()
    for package in ("common", "services"):
        for path in sorted((root / package).rglob("*.py")):
            source = path.read_bytes()
            if b"numba" in source or b"common.kernel" in source:
                digest.update(str(path.relative_to(root)).encode())
                digest.update(source)
    return digest.hexdigest()[:16]
