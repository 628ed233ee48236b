"""How this suite compiles its kernels.

A `batch_kernel` is called from Python with a row range: it allocates its scratch once and loops.
A `kernel` is called by other kernels and owns no memory: it is compiled without Numba's reference
counting, whose atomic increments for every array of a packed scene cost ten times the arithmetic.
A `lane_kernel` is a `kernel` whose inner loops run over a fixed number of lanes, so that every lane
goes through the same instructions; it may fuse a product and a sum into one rounding.
All release the GIL, follow IEEE rules for division, and are cached on disk. There is no other
fastmath: row i of a batch must be bit-equal to a batch of one.
"""

from __future__ import annotations

from numba import njit

batch_kernel = njit(cache=True, nogil=True, error_model="numpy")
kernel = njit(cache=True, nogil=True, error_model="numpy", _nrt=False)
lane_kernel = njit(cache=True, nogil=True, error_model="numpy", _nrt=False, fastmath={"contract"})
