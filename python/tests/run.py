# SPDX-License-Identifier: Apache-2.0
"""Runs pytest with these arguments where it is installed; says "skipped: ..." elsewhere."""
import sys

try:
    import numpy  # noqa: F401
    import pytest
except ImportError as error:
    print(f"skipped: {error}")
    sys.exit(0)
sys.dont_write_bytecode = True
sys.exit(pytest.main(sys.argv[1:]))
